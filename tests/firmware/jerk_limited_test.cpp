#include "firmware/motion/jerk_limited.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "firmware/motion/motion_limits.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

constexpr Real kInfinity = std::numeric_limits<Real>::infinity();
constexpr Real kNan = std::numeric_limits<Real>::quiet_NaN();

Profile profile_of(Real position, Real velocity, const PlannedPieces& pieces) {
  Profile profile;
  EXPECT_TRUE(profile.set(position, velocity, pieces.piece.data(), pieces.count));
  return profile;
}

// Acceleration is continuous, and begins and ends where it should.
void expect_continuous(const PlannedPieces& pieces, Real acceleration) {
  for (int i = 0; i < pieces.count; ++i) {
    const ProfilePiece& piece = pieces.piece[static_cast<std::size_t>(i)];
    ASSERT_EQ(piece.acceleration_start, acceleration) << "piece " << i;
    acceleration = piece.acceleration_end;
  }
  ASSERT_EQ(acceleration, 0);
}

class Random {
 public:
  explicit Random(unsigned seed) : random_(seed) {}
  Real between(Real low, Real high) { return std::uniform_real_distribution<Real>(low, high)(random_); }
  // Over six decades, either sign.
  Real wide() { return std::copysign(std::pow(10, between(-3, 3)), between(-1, 1)); }

 private:
  std::mt19937 random_;
};

// The shortest time in which the double integrator (velocity, acceleration) comes to 0 with |jerk| <= j and no limit of
// the acceleration: bang-bang with one switch on the curve v = -a |a| / (2 j); textbook form, other than the code's.
Real unlimited_minimum(Real v, Real a, Real j) {
  const Real side = v + a * std::fabs(a) / (2 * j);
  const Real s = side > 0 ? 1 : -1;
  return (s * a + 2 * std::sqrt(std::fmax(a * a / 2 + s * j * v, 0))) / j;
}

TEST(PlanStop, RandomStatesEndAtRestInsideTheLimits) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(1618));
  RecordProperty("seed", static_cast<int>(seed));
  Random random(seed);
  int too_hard = 0, turned = 0, stretched = 0;
  for (int n = 0; n < 20000; ++n) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << " n " << n);
    const Real v = n % 7 == 0 ? 0 : random.wide(), a = n % 5 == 0 ? 0 : random.wide();
    const MotionLimits limits{kInfinity, std::fabs(random.wide()), std::fabs(random.wide())};
    PlannedPieces fastest;
    ASSERT_TRUE(plan_stop(v, a, limits, 0, fastest));
    ASSERT_LE(fastest.count, 3);
    const Real shortest = fastest.duration_s();
    for (const Real duration : {Real{0}, shortest * random.between(1, 3)}) {
      PlannedPieces pieces;
      ASSERT_TRUE(plan_stop(v, a, limits, duration, pieces));
      expect_continuous(pieces, pieces.count > 0 ? a : 0);
      const Profile profile = profile_of(0.7, v, pieces);
      EXPECT_EQ(profile.final_velocity(), 0);
      EXPECT_TRUE(profile.at_rest_from(profile.end_s()));
      EXPECT_TRUE(
          check_limits(profile, {kInfinity, std::fmax(limits.max_acceleration, std::fabs(a)), limits.max_jerk}).ok());
      too_hard += std::fabs(a) > limits.max_acceleration;
      // Beyond the limit, the acceleration only comes back. Sampled; and the velocity turns only where it has to: where
      // taking the acceleration to 0 at once would turn it.
      const Real left = v + a * std::fabs(a) / (2 * limits.max_jerk);
      const bool may_turn = v * left < 0 || v == 0;
      turned += may_turn;
      Real before = std::fabs(a);
      for (int k = 0; k <= 50; ++k) {
        const ProfilePoint p = profile.at(profile.end_s() * k / 50);
        if (before > limits.max_acceleration) {
          ASSERT_LE(std::fabs(p.acceleration), before * (1 + 1e-9));
        }
        before = std::fabs(p.acceleration);
        // 1e-9: rounding of the sums, with room.
        const Real scale = std::fabs(v) + a * a / limits.max_jerk;
        if (!may_turn) {
          ASSERT_GE(std::copysign(1, v) * p.velocity, -1e-9 * scale);
        }
      }
      if (!may_turn && v != 0) {
        // On the right side of where it was.
        EXPECT_GE((profile.at(profile.end_s()).position - 0.7) * v, 0);
      }
      if (duration > 0 && std::fabs(left) > 1e-6 * std::fabs(v)) {
        ++stretched;
        // The durations are sums of three quotients, whose peak is a root of numbers of very different size.
        EXPECT_NEAR(profile.end_s() / duration, 1, 1e-6);
        for (int i = 0; i < pieces.count; ++i) {
          const Real end = std::fabs(pieces.piece[static_cast<std::size_t>(i)].acceleration_end);
          EXPECT_LE(end, std::fmax(limits.max_acceleration, std::fabs(a)));
        }
      }
    }
  }
  EXPECT_GT(too_hard, 1000);
  EXPECT_GT(turned, 1000);
  EXPECT_GT(stretched, 10000);
}

// A motion that comes to rest by itself: its last ramp brings velocity and acceleration to 0 together, except for
// rounding, which decides the direction of braking.
TEST(PlanStop, OutOfTheLastRampOfAMotion) {
  const std::uint64_t seed = ballast::test::random_seed(2718);
  RecordProperty("seed", std::to_string(seed));
  Random random(static_cast<unsigned>(seed));
  for (int n = 0; n < 20000; ++n) {
    const Real jerk = std::fabs(random.wide()), a = random.wide();
    const Real off = n % 3 == 0 ? 0 : std::pow(10, random.between(-17, -6)) * (n % 2 == 0 ? 1 : -1);
    const Real v = -a * std::fabs(a) / (2 * jerk) * (1 + off);
    SCOPED_TRACE(::testing::Message() << "seed " << seed << " n " << n << " off " << off);
    const MotionLimits limits{kInfinity, std::fabs(a) * random.between(1, 2), jerk};
    PlannedPieces fastest;
    ASSERT_TRUE(plan_stop(v, a, limits, 0, fastest));
    const Real shortest = fastest.duration_s();
    // The ramp, and what off leaves: a triangle of its square root at most.
    EXPECT_LE(shortest, std::fabs(a) / jerk * (1 + 4 * std::sqrt(std::fabs(off) + 1e-15)));
    for (const Real duration : {Real{0}, shortest * random.between(1, 10)}) {
      PlannedPieces pieces;
      ASSERT_TRUE(plan_stop(v, a, limits, duration, pieces));
      const Profile profile = profile_of(0.7, v, pieces);
      EXPECT_TRUE(profile.at_rest_from(profile.end_s()));
      EXPECT_TRUE(check_limits(profile, {kInfinity, std::fmax(limits.max_acceleration, std::fabs(a)), jerk}).ok());
      EXPECT_LE(profile.end_s(), std::fmax(shortest, duration) * (1 + 1e-12));
    }
  }
}

TEST(PlanStop, WithoutAccelerationLimitItIsTheShortest) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(3));
  RecordProperty("seed", static_cast<int>(seed));
  Random random(seed);
  for (int n = 0; n < 5000; ++n) {
    const Real v = random.wide(), a = random.wide(), jerk = std::fabs(random.wide());
    PlannedPieces pieces;
    ASSERT_TRUE(plan_stop(v, a, {kInfinity, 1e9, jerk}, 0, pieces));
    const Real least = unlimited_minimum(v, a, jerk);
    // Differences of terms up to |a|/jerk and its square: 1e-7 where they cancel to a root.
    EXPECT_NEAR(pieces.duration_s(), least, 1e-12 * least + 1e-7 * std::fabs(a) / jerk)
        << "seed " << seed << " n " << n;
  }
}

// With both limits: among all stops jerk +-J, constant, jerk +-J through any intermediate acceleration, found by
// trying, none is shorter.
TEST(PlanStop, NoOtherPeakIsShorter) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(4));
  RecordProperty("seed", static_cast<int>(seed));
  Random random(seed);
  for (int n = 0; n < 300; ++n) {
    const Real v = random.between(-3, 3), a = random.between(-3, 3), A = random.between(0.2, 3),
               J = random.between(0.5, 10);
    PlannedPieces pieces;
    ASSERT_TRUE(plan_stop(v, a, {kInfinity, A, J}, 0, pieces));
    Real best = kInfinity;
    for (int k = -2000; k <= 2000; ++k) {
      const Real b = A * k / 2000;  // the intermediate acceleration
      const Real t1 = std::fabs(b - a) / J, t3 = std::fabs(b) / J;
      const Real rest = -(v + (a + b) / 2 * t1 + b / 2 * t3);  // what the constant part has to change
      if (b == 0 || rest / b < 0) continue;
      best = std::fmin(best, t1 + t3 + rest / b);
    }
    EXPECT_LE(pieces.duration_s(), best + 1e-12) << "seed " << seed << " n " << n;
    // And it is one of them: the grid of 2000 peaks misses the best by 5e-4 of A at most.
    if (std::isfinite(best) && std::fabs(v) > 0.5) {
      EXPECT_GT(pieces.duration_s(), best - 0.05);
    }
  }
}

TEST(PlanStop, KnownStops) {
  PlannedPieces p;
  ASSERT_TRUE(plan_stop(0, 0, {1, 1, 1}, 0, p));
  EXPECT_EQ(p.count, 0);
  ASSERT_TRUE(plan_stop(1, 0, {1, 10, 4}, 0, p));  // triangle: peak 2 after half a second
  EXPECT_EQ(p.count, 2);
  EXPECT_DOUBLE_EQ(p.duration_s(), 1);
  EXPECT_DOUBLE_EQ(p.piece[0].acceleration_end, -2);
  ASSERT_TRUE(plan_stop(-3, 0, {1, 1, 1}, 0, p));  // trapezium: 1 + 2 + 1 s
  EXPECT_EQ(p.count, 3);
  EXPECT_DOUBLE_EQ(p.duration_s(), 4);
  ASSERT_TRUE(plan_stop(-0.5, 1, {1, 1, 1}, 7, p));  // the acceleration's way to 0 stops it
  EXPECT_EQ(p.count, 1);
  EXPECT_DOUBLE_EQ(p.duration_s(), 1);
}

TEST(PlanStop, RefusesWhatIsNoNumber) {
  PlannedPieces p;
  p.count = 5;
  for (const Real bad : {kNan, kInfinity}) {
    EXPECT_FALSE(plan_stop(bad, 0, {1, 1, 1}, 0, p));
    EXPECT_FALSE(plan_stop(0, bad, {1, 1, 1}, 0, p));
    EXPECT_FALSE(plan_stop(1, 0, {1, bad, 1}, 0, p));
    EXPECT_FALSE(plan_stop(1, 0, {1, 1, bad}, 0, p));
    EXPECT_FALSE(plan_stop(1, 0, {1, 1, 1}, bad, p));
    EXPECT_FALSE(plan_move(bad, {1, 1, 1}, 0, p));
    EXPECT_FALSE(plan_move(1, {bad, 1, 1}, 0, p));
  }
  EXPECT_FALSE(plan_stop(1, 0, {1, 0, 1}, 0, p));
  EXPECT_FALSE(plan_stop(1, 0, {1, 1, -1}, 0, p));
  EXPECT_EQ(p.count, 5);
}

TEST(PlanMove, RandomMovesReachTheTargetInsideTheLimits) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(2236));
  RecordProperty("seed", static_cast<int>(seed));
  Random random(seed);
  int by_speed = 0, by_acceleration = 0, by_jerk = 0;
  for (int n = 0; n < 20000; ++n) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << " n " << n);
    const Real start = random.between(-2, 2), distance = random.wide();
    const MotionLimits limits{std::fabs(random.wide()), std::fabs(random.wide()), std::fabs(random.wide())};
    PlannedPieces fastest;
    ASSERT_TRUE(plan_move(distance, limits, 0, fastest));
    const Real shortest = fastest.duration_s();
    for (const Real duration : {Real{0}, shortest * random.between(1, 5)}) {
      PlannedPieces pieces;
      ASSERT_TRUE(plan_move(distance, limits, duration, pieces));
      expect_continuous(pieces, 0);
      const Profile profile = profile_of(start, 0, pieces);
      const ProfilePoint end = profile.at(profile.end_s());
      EXPECT_EQ(end.velocity, 0);
      EXPECT_TRUE(profile.at_rest_from(profile.end_s()));
      // Seven pieces, each a sum of three products.
      EXPECT_NEAR(end.position, start + distance, 1e-14 * (std::fabs(start) + std::fabs(distance)));
      EXPECT_TRUE(check_limits(profile, limits).ok()) << static_cast<int>(check_limits(profile, limits).what);
      EXPECT_NEAR(profile.end_s() / std::fmax(duration, shortest), 1, 1e-12);
      Real before = start;
      for (int k = 1; k <= 40; ++k) {
        const Real here = profile.at(profile.end_s() * k / 40).position;
        ASSERT_GE((here - before) * distance, -1e-12 * distance * distance) << "never back";
        before = here;
      }
    }
    // The shortest: of the three limits at least one is reached, and always the jerk.
    const Profile profile = profile_of(start, 0, fastest);
    const auto reached = [&](Real v, Real a, Real j) {
      return check_limits(profile, {limits.max_velocity * v, limits.max_acceleration * a, limits.max_jerk * j}).what;
    };
    EXPECT_EQ(reached(1, 1, 1 - 1e-6), Limited::kJerk);
    by_speed += reached(1 - 1e-6, 1, 1) == Limited::kVelocity;
    by_acceleration += reached(1, 1 - 1e-6, 1) == Limited::kAcceleration;
    by_jerk += reached(1 - 1e-6, 1 - 1e-6, 1) == Limited::kNothing;
  }
  EXPECT_GT(by_speed, 1000);
  EXPECT_GT(by_acceleration, 1000);
  EXPECT_GT(by_jerk, 1000);
}

TEST(PlanMove, ShortestTimesInClosedForm) {
  PlannedPieces p;
  ASSERT_TRUE(plan_move(2, {100, 100, 1}, 0, p));  // jerk only: distance 2 j t^3, t = 1
  EXPECT_EQ(p.count, 4);
  EXPECT_NEAR(p.duration_s(), 4, 1e-14);
  ASSERT_TRUE(plan_move(-6, {100, 1, 1}, 0, p));  // v (v + 1) = 6: v = 2, twice 2 + 1 s
  EXPECT_NEAR(p.duration_s(), 6, 1e-14);
  ASSERT_TRUE(plan_move(10, {2, 1, 1}, 0, p));  // v = 2 after 3 s, 6 of the 10 used: 2 s of cruise
  EXPECT_EQ(p.count, 7);
  EXPECT_NEAR(p.duration_s(), 8, 1e-14);
  ASSERT_TRUE(plan_move(0, {1, 1, 1}, 5, p));
  EXPECT_EQ(p.count, 0);
}

TEST(MotionLimits, NameThePieceAndTheWorstOfIt) {
  const ProfilePiece pieces[] = {{1, 0, 2}, {1, 2, -4}, {2, -1, -1}};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 0, pieces, 3));
  // Velocity: 1, then on top at 1/3 s of the second 1 + 1/3, 0 at its end, then down to -2.
  EXPECT_TRUE(check_limits(profile, {2, 4, 6}).ok());
  LimitBreach breach = check_limits(profile, {1.3, 9, 9});
  EXPECT_EQ(breach.what, Limited::kVelocity);
  EXPECT_EQ(breach.piece, 1);
  EXPECT_DOUBLE_EQ(breach.value, 4.0 / 3);
  breach = check_limits(profile, {1.9, 9, 9});
  EXPECT_EQ(breach.piece, 2);
  EXPECT_DOUBLE_EQ(breach.value, 2);
  breach = check_limits(profile, {9, 3.9, 9});
  EXPECT_EQ(breach.what, Limited::kAcceleration);
  EXPECT_EQ(breach.piece, 1);
  EXPECT_DOUBLE_EQ(breach.value, 4);
  breach = check_limits(profile, {9, 9, 5.9});
  EXPECT_EQ(breach.what, Limited::kJerk);
  EXPECT_EQ(breach.piece, 1);
  EXPECT_DOUBLE_EQ(breach.value, 6);
  ASSERT_TRUE(profile.set(0, 3, nullptr, 0));
  EXPECT_EQ(check_limits(profile, {2, 1, 1}).piece, 0) << "what comes after the last piece counts too";
}

}  // namespace
}  // namespace ballast::firmware
