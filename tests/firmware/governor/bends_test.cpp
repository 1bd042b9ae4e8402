#include "firmware/governor/bends.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

namespace ballast::firmware {
namespace {

constexpr Wide kPeriod_s = 0.001;
constexpr Real kTolerance = Real(1e-3);

PerMass<Real> both(Real a, Real b) { return {a, b}; }

std::unique_ptr<Bends> empty() {
  auto bends = std::make_unique<Bends>();
  bends->clear(0, both(kTolerance, kTolerance));
  return bends;
}

TEST(Bends, AreLinesBetweenPointsAndNothingOutside) {
  const auto bends = empty();
  ASSERT_TRUE(bends->add(0.1, both(0, 1)));
  ASSERT_TRUE(bends->add(0.2, both(1, -1)));
  ASSERT_TRUE(bends->add(0.3, both(1, 0)));
  // Points are kept in single precision.
  EXPECT_NEAR(bends->at(0.125, kPeriod_s)[0], 0.25, 1e-6);
  EXPECT_NEAR(bends->at(0.125, kPeriod_s)[1], 0.5, 1e-6);
  EXPECT_NEAR(bends->at(0.25, kPeriod_s)[0], 1, 1e-6);
  for (const Wide outside : {0.05, 0.1, 0.31}) {
    EXPECT_EQ(bends->at(outside, kPeriod_s)[0], 0) << outside;
    EXPECT_EQ(bends->at(outside, kPeriod_s)[1], 0) << outside;
  }
}

// Two points at one time: the earlier one counts up to it, and the later one from there.
TEST(Bends, JumpAfterTheTimeOfTwoPoints) {
  const auto bends = empty();
  ASSERT_TRUE(bends->add(0.1, both(1, 0)));
  ASSERT_TRUE(bends->add(0.2, both(1, 0)));
  ASSERT_TRUE(bends->add(0.2, both(-3, 0)));
  ASSERT_TRUE(bends->add(0.3, both(-3, 0)));
  EXPECT_NEAR(bends->at(0.2, kPeriod_s)[0], 1, 1e-6);
  EXPECT_NEAR(bends->at(0.2 + 1e-12, kPeriod_s)[0], 1, 1e-6);
  EXPECT_NEAR(bends->at(0.201, kPeriod_s)[0], -3, 1e-6);
}

// A parabola of many points is within the tolerance of few lines, and what is within the tolerance of 0 is 0.
TEST(Bends, LeavesOutWhatLinesPass) {
  const auto bends = empty();
  const auto curve = [](Wide t) { return static_cast<Real>(t * (2 - t)); };
  // A chord over a span w is off a parabola of curvature 2 by w^2 / 4 at most, so that spans are at least
  // sqrt(4 kTolerance) = 0.063 wide: 10,000 points would not fit otherwise.
  for (int k = 0; k <= 10000; ++k) {
    const Wide t = 2e-4 * k;
    ASSERT_TRUE(bends->add(t, both(curve(t), kTolerance / 2))) << k;
  }
  for (int k = 1; k <= 10000; ++k) {
    const Wide t = 2e-4 * k;
    const Real got = bends->at(t, kPeriod_s)[0], expected = curve(t);
    // Within a quarter of a period of a point, times are one: up to 5e-4 of the slope.
    EXPECT_NEAR(got, expected, 2 * kTolerance + 5e-4) << t;
    EXPECT_EQ(bends->at(t, kPeriod_s)[1], 0) << t;
  }
}

TEST(Bends, SayWhenThereIsNoRoom) {
  const auto bends = empty();
  int k = 0;
  while (k <= Bends::kMost && bends->add(k, both(k % 2 == 0 ? 1 : -1, 0))) ++k;
  EXPECT_EQ(k, Bends::kMost);
}

TEST(Bends, MoveWithTheTickThatTheyCountFrom) {
  const auto bends = empty();
  bends->shift(12);
  EXPECT_EQ(bends->start_tick(), 12);
  ASSERT_TRUE(bends->add(0, both(1, 0)));
  bends->clear(3, both(kTolerance, kTolerance));
  EXPECT_EQ(bends->start_tick(), 3);
  EXPECT_EQ(bends->at(0, kPeriod_s)[0], 0);
}

}  // namespace
}  // namespace ballast::firmware
