#include "firmware/motion/burst.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

std::vector<PulseWindow> at_ticks(const std::vector<Real>& exact) {
  std::vector<PulseWindow> pulses(exact.size());
  for (std::size_t j = 0; j < exact.size(); ++j) {
    pulses[j].exact_ticks = exact[j];
    pulses[j].direction = 1;
  }
  return pulses;
}

// Rules of a motor that may step in every timer tick.
PulseRules rules_of(const StepTiming& timing) { return {timing, timing.timer_frequency_hz}; }

TEST(LastTimerTick, StaysInsideTheControlTick) {
  EXPECT_EQ(last_timer_tick({1e7, 0.001}), 9999);
  EXPECT_EQ(last_timer_tick({1e6, 0.0007}), 699) << "the product rounds to 699.99.. or 700.00..";
  EXPECT_EQ(last_timer_tick({1e7, 1.0 / 3000}), 3333) << "3333.33 timer ticks";
  EXPECT_EQ(last_timer_tick({1e9, 1}), 999999999);
}

TEST(MakeWindows, ToleranceIsHalfAMicrosecondOrATick) {
  const PulseRules fast = rules_of({1e7, 0.001}), slow = rules_of({1e5, 0.001});
  auto pulses = at_ticks({50.3, 500.6});
  ASSERT_TRUE(make_windows(pulses, fast));
  EXPECT_EQ(pulses[0].nearest(), 50);
  EXPECT_EQ(pulses[0].low, 46);
  EXPECT_EQ(pulses[0].high, 55);
  EXPECT_EQ(pulses[1].nearest(), 501);
  pulses = at_ticks({50.3});
  ASSERT_TRUE(make_windows(pulses, slow));
  EXPECT_EQ(pulses[0].low, 50);
  EXPECT_EQ(pulses[0].high, 51);
}

TEST(MakeWindows, NeverInTheNextControlTick) {
  auto pulses = at_ticks({0, 9999.7});
  ASSERT_TRUE(make_windows(pulses, rules_of({1e7, 0.001})));
  EXPECT_EQ(pulses[0].low, 0);
  EXPECT_EQ(pulses[1].nearest(), 9999);
  EXPECT_EQ(pulses[1].high, 9999);
}

TEST(MakeWindows, WhatCannotKeepItsDistanceIsRefused) {
  const StepTiming timing{1e7, 0.001};
  auto pulses = at_ticks({10.1, 10.3, 10.5});
  EXPECT_TRUE(make_windows(pulses, rules_of(timing))) << "a timer tick apart, still within 0.5 us";
  // 100 timer ticks at least; 99 after rounding. The tolerance of 5 timer ticks each way makes up for 10.
  const PulseRules slow{timing, 1e5};
  EXPECT_EQ(slow.gap, 99);
  pulses = at_ticks({1000, 1090});
  EXPECT_TRUE(make_windows(pulses, slow));
  pulses = at_ticks({1000, 1088.5});
  EXPECT_FALSE(make_windows(pulses, slow));
  pulses = at_ticks({1000});
  EXPECT_TRUE(make_windows(pulses, slow, 1005));
  EXPECT_FALSE(make_windows(pulses, slow, 1006));
}

TEST(MakeWindows, OppositePulsesKeepTheSetUpTime) {
  const PulseRules rules{{1e7, 0.001, 20e-6}, 1e6};
  EXPECT_EQ(rules.gap, 9);
  EXPECT_EQ(rules.turn_gap, 200);
  auto pulses = at_ticks({100, 195});
  EXPECT_TRUE(make_windows(pulses, rules));
  pulses[1].direction = -1;
  EXPECT_FALSE(make_windows(pulses, rules));
  EXPECT_EQ(rules.earliest_after(50, true), 150);
  EXPECT_EQ(rules.earliest_after(50, false), 0);
  // Without a set-up time a turn needs no more than any pulse: the spacing of 10, less one tick of rounding.
  const PulseRules at_once{{1e7, 0.001, 0}, 1e6};
  EXPECT_EQ(at_once.earliest_after(2, false), 7);
  EXPECT_EQ(at_once.earliest_after(2, true), 7);
}

// The next pulse can keep its distance for every choice in the windows of the pulses before.
TEST(MakeWindows, AnyChoiceLeavesRoomForTheNext) {
  const PulseRules rules{{1e7, 0.001}, 1e6};
  auto pulses = at_ticks({10, 20, 29.5, 40, 51});
  ASSERT_TRUE(make_windows(pulses, rules));
  for (std::size_t j = 0; j < pulses.size(); ++j) {
    EXPECT_LE(pulses[j].low, pulses[j].high);
    if (j > 0) {
      EXPECT_LE(pulses[j - 1].high + rules.gap, pulses[j].high);
      EXPECT_GE(pulses[j].low, pulses[j - 1].low + rules.gap);
    }
  }
}

TEST(MakeWindows, NoLaterThanItsCrossingBeforeABorder) {
  const PulseRules rules{{1e7, 0.001}, 1e5};
  auto pulses = at_ticks({9950.9});
  ASSERT_TRUE(make_windows(pulses, rules));
  EXPECT_EQ(pulses[0].high, 9950);
  pulses = at_ticks({9800.9});
  ASSERT_TRUE(make_windows(pulses, rules));
  EXPECT_EQ(pulses[0].high, 9805);
}

TEST(LongestBurst, UniformAndQuadraticTrainsAreOneBurst) {
  const PulseRules rules = rules_of({1e7, 0.02});
  std::vector<Real> uniform, quadratic;
  for (int j = 0; j < 64; ++j) {
    uniform.push_back(17 + 1000.0 * j);
    quadratic.push_back(5 + 2000.0 * j - 7.0 * j * (j - 1) / 2);
  }
  auto pulses = at_ticks(uniform);
  ASSERT_TRUE(make_windows(pulses, rules));
  StepBurst burst = longest_burst(pulses, rules);
  EXPECT_EQ(burst.count, 64);
  EXPECT_EQ(burst.interval_ticks, 1000);
  EXPECT_EQ(burst.add_ticks, 0);
  pulses = at_ticks(quadratic);
  ASSERT_TRUE(make_windows(pulses, rules));
  burst = longest_burst(pulses, rules);
  EXPECT_EQ(burst.count, 64);
  EXPECT_EQ(burst.first_ticks, 5);
  EXPECT_EQ(burst.interval_ticks, 2000);
  EXPECT_EQ(burst.add_ticks, -7);
}

TEST(LongestBurst, EndsWhereTheDirectionChanges) {
  auto pulses = at_ticks({100, 200, 300, 500, 600});
  pulses[3].direction = pulses[4].direction = -1;
  const PulseRules rules = rules_of({1e7, 0.001});
  ASSERT_TRUE(make_windows(pulses, rules));
  EXPECT_EQ(longest_burst(pulses, rules).count, 3);
  const StepBurst second = longest_burst(std::span<const PulseWindow>(pulses).subspan(3), rules);
  EXPECT_EQ(second.count, 2);
  EXPECT_EQ(second.direction, -1);
}

TEST(LongestBurst, RandomTrainsReplayInsideTheirWindows) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(4));
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  const PulseRules rules = rules_of({1e7, 0.001});
  std::uniform_real_distribution<Real> gap(1.5, 150);
  for (int k = 0; k < 20000; ++k) {
    std::vector<Real> exact{gap(random)};
    for (int j = 1; j < 64; ++j) exact.push_back(exact.back() + gap(random));
    auto pulses = at_ticks(exact);
    if (!make_windows(pulses, rules)) continue;
    std::size_t done = 0;
    std::int64_t last = -1;
    while (done < pulses.size()) {
      const StepBurst b =
          longest_burst(std::span<const PulseWindow>(pulses).subspan(done), rules, static_cast<std::int32_t>(last + 1));
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

// The bound of validate(): three pulses of one direction fit one burst, wherever they are, at the step rate or far
// below it, after a burst that ends late or not. So k of them need at most (k + 2) / 3 bursts.
TEST(LongestBurst, AnyThreePulsesOfOneDirectionFit) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(31));
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> u(0, 1);
  int seen = 0;
  for (int k = 0; k < 100000; ++k) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", case " << k);
    const PulseRules rules{{std::pow(10, 6 + 2 * u(random)), 0.001}, 2e4 * std::pow(25, u(random))};
    const auto size = static_cast<std::size_t>(1 + u(random) * 30);
    // Distances from the least on, up to a hundred times that; in half of the cases all near the least.
    const Real widest = u(random) < 0.5 ? 1.02 : 100;
    std::vector<Real> exact{rules.last_tick * 0.3 * u(random)};
    while (exact.size() < size) {
      exact.push_back(exact.back() + rules.spacing_ticks * std::pow(widest, u(random) * u(random)));
    }
    if (!(exact.back() < rules.last_tick)) continue;
    auto pulses = at_ticks(exact);
    auto earliest = static_cast<std::int32_t>(std::lround(exact[0] + rules.tolerance_ticks * (2 * u(random) - 1)));
    if (!make_windows(pulses, rules, earliest)) continue;
    ++seen;
    std::size_t done = 0, bursts = 0;
    for (; done < size; ++bursts) {
      const auto left = std::span(pulses).subspan(done);
      const StepBurst burst = longest_burst(left, rules, earliest);
      const auto count = static_cast<std::size_t>(burst.count);
      ASSERT_GE(count, std::min<std::size_t>(3, left.size()));
      ASSERT_GE(pulse_ticks(burst, 0), earliest);
      for (int j = 1; j < burst.count; ++j) ASSERT_GE(pulse_ticks(burst, j) - pulse_ticks(burst, j - 1), rules.gap);
      ASSERT_LE(static_cast<Real>(pulse_ticks(burst, burst.count - 1)), rules.last_tick);
      done += count;
      earliest = static_cast<std::int32_t>(pulse_ticks(burst, burst.count - 1)) + rules.gap;
      if (done < size) raise_lows(std::span(pulses).subspan(done), earliest);
    }
    ASSERT_LE(bursts, (size + 2) / 3);
  }
  EXPECT_GT(seen, 30000);
}

}  // namespace
}  // namespace ballast::firmware
