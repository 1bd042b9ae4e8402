#include "firmware/motion/crossing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

TEST(MonotoneSpans, KnownRoots) {
  // velocity (w - 0.25)(w - 0.75) * 6 = 6 w^2 - 6 w + 1.125
  const StepCubic cubic{0, 1.125, -6, 12};
  const MonotoneSpans spans = monotone_spans(cubic, 1);
  ASSERT_EQ(spans.count, 3);
  EXPECT_DOUBLE_EQ(spans.end_s[0], 0.25);
  EXPECT_DOUBLE_EQ(spans.end_s[1], 0.75);
  EXPECT_EQ(spans.end_s[2], 1);
  EXPECT_EQ(monotone_spans(cubic, 0.5).count, 2);
  EXPECT_EQ(monotone_spans(cubic, 0.2).count, 1);
}

TEST(MonotoneSpans, Degenerate) {
  EXPECT_EQ(monotone_spans({3, 0, 0, 0}, 1).count, 1) << "at rest";
  EXPECT_EQ(monotone_spans({3, 2, 0, 0}, 1).count, 1) << "constant velocity";
  EXPECT_EQ(monotone_spans({0, 0, 1, 0}, 1).count, 1) << "turning at the border";
  const MonotoneSpans parabola = monotone_spans({0, 1, -2, 0}, 1);
  ASSERT_EQ(parabola.count, 2);
  EXPECT_EQ(parabola.end_s[0], 0.5);
  EXPECT_EQ(monotone_spans({0, 1, 0, 6}, 1).count, 1) << "no real root";
  // A root that the textbook formula would lose to cancellation: 1e-8 + w (-1 + 1e-9 w).
  const MonotoneSpans tiny = monotone_spans({0, 1e-8, -1, 2e-9}, 1);
  ASSERT_EQ(tiny.count, 2);
  EXPECT_NEAR(tiny.end_s[0], 1e-8, 1e-22);
}

TEST(CrossingTime, RandomCubicsAgreeWithLongDoubleBisection) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(12345));
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> u(-1, 1);
  const Real tolerance = 1e-10;
  int crossings = 0;
  for (int k = 0; k < 20000; ++k) {
    const StepCubic c{100 * u(random), 1e4 * u(random), 2e7 * u(random), 4e10 * u(random)};
    const auto exact = [&c](long double w) {
      return c.x + w * (c.velocity + w * (c.acceleration / 2.0L + w * c.jerk / 6.0L));
    };
    const MonotoneSpans spans = monotone_spans(c, 1e-3);
    Real begin = 0;
    for (int i = 0; i < spans.count; ++i) {
      const Real end = spans.end_s[static_cast<std::size_t>(i)];
      const Real a = c.at(begin), b = c.at(end);
      const Real level = a + (b - a) * (0.5 + 0.49 * u(random));
      long double low = begin, high = end;
      for (int j = 0; j < 80; ++j) {
        const long double middle = (low + high) / 2;
        ((exact(middle) < level) == (b > a) ? low : high) = middle;
      }
      const Real found = crossing_time(c, level, begin, end, tolerance);
      // Newton stops when a step is below the tolerance; beside a turning point half the error remains. Rounding of x
      // (1e-14) moves a crossing by 1e-14 / velocity, below the tolerance wherever the velocity exceeds 1e-4.
      ASSERT_NEAR(found, static_cast<Real>(low), 2 * tolerance) << "seed " << seed << " case " << k;
      begin = end;
      ++crossings;
    }
  }
  EXPECT_GT(crossings, 20000);
}

TEST(CrossingTime, FlatCubicIsStillFound) {
  // x = (w - 0.5)^3: at the level 0 the velocity vanishes, Newton only creeps.
  const StepCubic c{-0.125, 0.75, -3, 6};
  EXPECT_NEAR(crossing_time(c, 0, 0, 1, 1e-12), 0.5, 1e-5) << "x is known to 1e-16 only, so w to its cube root";
  EXPECT_NEAR(crossing_time(c, 1e-9, 0, 1, 1e-12), 0.501, 1e-9);
}

TEST(CrossingTime, LevelOutsideIsTheNearerEnd) {
  const StepCubic up{0, 1, 0, 0}, down{0, -1, 0, 0};
  EXPECT_EQ(crossing_time(up, -0.1, 0, 1, 1e-9), 0);
  EXPECT_EQ(crossing_time(up, 1.1, 0, 1, 1e-9), 1);
  EXPECT_EQ(crossing_time(down, 0.1, 0, 1, 1e-9), 0);
  EXPECT_EQ(crossing_time(down, -1.1, 0, 1, 1e-9), 1);
}

}  // namespace
}  // namespace ballast::firmware
