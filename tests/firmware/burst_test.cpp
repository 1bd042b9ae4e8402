#include "firmware/motion/burst.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace ballast::firmware {
namespace {

std::vector<PulseWindow> at_ticks(const std::vector<Real>& exact) {
  std::vector<PulseWindow> pulses(exact.size());
  for (std::size_t j = 0; j < exact.size(); ++j) pulses[j].exact_ticks = exact[j];
  return pulses;
}

TEST(LastTimerTick, StaysInsideTheControlTick) {
  EXPECT_EQ(last_timer_tick({1e7, 0.001}), 9999);
  EXPECT_EQ(last_timer_tick({1e6, 0.0007}), 699) << "the product rounds to 699.99.. or 700.00..";
  EXPECT_EQ(last_timer_tick({1e7, 1.0 / 3000}), 3333) << "3333.33 timer ticks";
  EXPECT_EQ(last_timer_tick({1e9, 1}), 999999999);
}

TEST(MakeWindows, ToleranceIsHalfAMicrosecondOrATick) {
  const StepTiming fast{1e7, 0.001}, slow{1e5, 0.001};
  auto pulses = at_ticks({50.3, 500.6});
  ASSERT_TRUE(make_windows(pulses, fast));
  EXPECT_EQ(pulses[0].nearest, 50);
  EXPECT_EQ(pulses[0].low, 46);
  EXPECT_EQ(pulses[0].high, 55);
  EXPECT_EQ(pulses[1].nearest, 501);
  pulses = at_ticks({50.3});
  ASSERT_TRUE(make_windows(pulses, slow));
  EXPECT_EQ(pulses[0].low, 50);
  EXPECT_EQ(pulses[0].high, 51);
}

TEST(MakeWindows, NeverInTheNextControlTick) {
  auto pulses = at_ticks({0, 9999.7});
  ASSERT_TRUE(make_windows(pulses, {1e7, 0.001}));
  EXPECT_EQ(pulses[0].low, 0);
  EXPECT_EQ(pulses[1].nearest, 9999);
  EXPECT_EQ(pulses[1].high, 9999);
}

TEST(MakeWindows, SameTimerTickIsRefused) {
  auto pulses = at_ticks({10.1, 10.3});
  EXPECT_FALSE(make_windows(pulses, {1e7, 0.001}));
}

TEST(MakeWindows, NeighboursDoNotOverlap) {
  auto pulses = at_ticks({10, 12, 13, 17});
  ASSERT_TRUE(make_windows(pulses, {1e7, 0.001}));
  for (std::size_t j = 0; j < pulses.size(); ++j) {
    EXPECT_LE(pulses[j].low, pulses[j].nearest);
    EXPECT_GE(pulses[j].high, pulses[j].nearest);
    if (j > 0) {
      EXPECT_LT(pulses[j - 1].high, pulses[j].low);
    }
  }
}

TEST(LongestBurst, UniformAndQuadraticTrainsAreOneBurst) {
  const StepTiming timing{1e7, 0.02};
  std::vector<Real> uniform, quadratic;
  for (int j = 0; j < 64; ++j) {
    uniform.push_back(17 + 1000.0 * j);
    quadratic.push_back(5 + 2000.0 * j - 7.0 * j * (j - 1) / 2);
  }
  auto pulses = at_ticks(uniform);
  ASSERT_TRUE(make_windows(pulses, timing));
  StepBurst burst = longest_burst(pulses);
  EXPECT_EQ(burst.count, 64);
  EXPECT_EQ(burst.interval_ticks, 1000);
  EXPECT_EQ(burst.add_ticks, 0);
  pulses = at_ticks(quadratic);
  ASSERT_TRUE(make_windows(pulses, timing));
  burst = longest_burst(pulses);
  EXPECT_EQ(burst.count, 64);
  EXPECT_EQ(burst.first_ticks, 5);
  EXPECT_EQ(burst.interval_ticks, 2000);
  EXPECT_EQ(burst.add_ticks, -7);
}

TEST(LongestBurst, EndsWhereTheDirectionChanges) {
  auto pulses = at_ticks({100, 200, 300, 500, 600});
  pulses[3].direction = pulses[4].direction = -1;
  ASSERT_TRUE(make_windows(pulses, {1e7, 0.001}));
  EXPECT_EQ(longest_burst(pulses).count, 3);
  const StepBurst second = longest_burst(std::span<const PulseWindow>(pulses).subspan(3));
  EXPECT_EQ(second.count, 2);
  EXPECT_EQ(second.direction, -1);
}

TEST(LongestBurst, RandomTrainsReplayInsideTheirWindows) {
  const unsigned seed = 4;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> gap(1.5, 150);
  for (int k = 0; k < 20000; ++k) {
    std::vector<Real> exact{gap(random)};
    for (int j = 1; j < 64; ++j) exact.push_back(exact.back() + gap(random));
    auto pulses = at_ticks(exact);
    if (!make_windows(pulses, {1e7, 0.001})) continue;
    std::size_t done = 0;
    std::int64_t last = -1;
    while (done < pulses.size()) {
      const StepBurst b = longest_burst(std::span<const PulseWindow>(pulses).subspan(done));
      ASSERT_GE(b.count, 1);
      for (std::int64_t j = 0; j < b.count; ++j, ++done) {
        const std::int64_t t = b.first_ticks + j * b.interval_ticks + std::int64_t{b.add_ticks} * (j * (j - 1) / 2);
        ASSERT_LE(std::fabs(static_cast<Real>(t) - pulses[done].exact_ticks), 5.0) << "seed " << seed << " case " << k;
        ASSERT_GT(t, last);
        last = t;
      }
    }
  }
}

}  // namespace
}  // namespace ballast::firmware
