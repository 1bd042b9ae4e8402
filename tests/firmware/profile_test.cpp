#include "firmware/motion/profile.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

constexpr Real kEps = std::numeric_limits<Real>::epsilon();
constexpr Real kNan = std::numeric_limits<Real>::quiet_NaN();
constexpr Real kInfinity = std::numeric_limits<Real>::infinity();

struct LongPoint {
  long double position, velocity, acceleration;
};

// theta'' integrated twice in closed form, piece by piece, in long double; piece ends are sums of durations.
LongPoint exact(long double p, long double v, const std::vector<ProfilePiece>& pieces, long double t) {
  for (const ProfilePiece& piece : pieces) {
    const long double d = piece.duration_s, a0 = piece.acceleration_start, a1 = piece.acceleration_end;
    const long double s = t < d ? t : d;
    const long double slope = (a1 - a0) / d;
    const long double p1 = p + v * s + a0 * s * s / 2 + slope * s * s * s / 6;
    const long double v1 = v + a0 * s + slope * s * s / 2;
    if (t < d) return {p1, v1, a0 + slope * s};
    p = p1;
    v = v1;
    t -= d;
  }
  return {p + v * t, v, 0};
}

TEST(Profile, PaperMotion) {
  const ProfilePiece pieces[] = {{0.1, 1, 1}, {0.1, 1, 0}};
  Profile profile;
  ASSERT_TRUE(profile.set(2.0369, 0, pieces, 2));
  EXPECT_EQ(profile.at(0).position, 2.0369);
  EXPECT_EQ(profile.at(0).acceleration, 1);
  EXPECT_NEAR(profile.at(0.05).position, 2.0369 + 0.00125, 4 * kEps);
  EXPECT_NEAR(profile.at(0.1).velocity, 0.1, kEps);
  // integral of 2 - 10 t from .1 to .2 is .05
  EXPECT_NEAR(profile.final_velocity(), 0.15, kEps);
  EXPECT_NEAR(profile.at(0.2).acceleration, 0, 0);
  // position at .2: .005 + .01 + (.005 - .1^3 * 10 / 6)
  EXPECT_NEAR(profile.at(0.2).position, 2.0369 + 0.005 + 0.01 + 0.005 - 0.01 / 6, 8 * kEps);
  EXPECT_EQ(profile.end_s(), 0.2);
}

TEST(Profile, RandomProfilesAgreeWithLongDouble) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(99));
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> u(-1, 1);
  std::uniform_real_distribution<Real> duration(1e-4, 0.3);
  for (int k = 0; k < 300; ++k) {
    std::vector<ProfilePiece> pieces(static_cast<std::size_t>(k % (kMaxPieces + 1)));
    for (ProfilePiece& p : pieces) p = {duration(random), 5 * u(random), 5 * u(random)};
    const Real p0 = 3 * u(random), v0 = u(random);
    Profile profile;
    ASSERT_TRUE(profile.set(p0, v0, pieces.data(), static_cast<int>(pieces.size())));
    ASSERT_EQ(profile.piece_count(), static_cast<int>(pieces.size()));
    std::uniform_real_distribution<Real> time(0, 1.2 * profile.end_s() + 0.1);
    for (int j = 0; j < 50; ++j) {
      const Real t = time(random);
      const LongPoint e = exact(p0, v0, pieces, t);
      const ProfilePoint p = profile.at(t);
      // Each of up to 128 borders adds a few roundings of velocities (below 40) and positions (below 1000).
      ASSERT_NEAR(p.velocity, static_cast<Real>(e.velocity), 40 * 400 * kEps) << "seed " << seed << " case " << k;
      ASSERT_NEAR(p.position, static_cast<Real>(e.position), 1000 * 400 * kEps) << "seed " << seed << " case " << k;
    }
  }
}

TEST(Profile, BordersBelongToTheLaterPiece) {
  const ProfilePiece pieces[] = {{0.25, 1, 2}, {0.5, -3, -4}};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 0, pieces, 2));
  EXPECT_EQ(profile.at(0.25).acceleration, -3);
  EXPECT_LT(std::fabs(profile.at(std::nextafter(0.25, 0)).acceleration - 2), 1e-14);
  EXPECT_EQ(profile.at(0.75).acceleration, 0);
  EXPECT_EQ(profile.locate(0).index, 0);
  EXPECT_EQ(profile.locate(0.25).index, 1);
  EXPECT_EQ(profile.locate(0.25).offset_s, 0);
  EXPECT_EQ(profile.locate(0.5).offset_s, 0.25);
  EXPECT_EQ(profile.locate(0.75).index, 2);
  EXPECT_EQ(profile.cubic_start_s(1), 0.25);
  EXPECT_TRUE(std::isinf(profile.cubic(2).duration_s));
  // Binary fractions: both sides of the border are exact, so they must be equal.
  const Cubic& c = profile.cubic(0);
  EXPECT_EQ(c.position + 0.25 * c.velocity + 0.03125 * c.acceleration + 0.25 * 0.25 * 0.25 / 6 * c.jerk,
            profile.at(0.25).position);
}

TEST(Profile, BeforeZeroTheStartIsHeld) {
  const ProfilePiece piece{1, 5, 5};
  Profile profile;
  ASSERT_TRUE(profile.set(1.5, 2, &piece, 1));
  EXPECT_EQ(profile.at(-3).position, 1.5);
  EXPECT_EQ(profile.at(-3).velocity, 2);
  EXPECT_EQ(profile.at(-3).acceleration, 0);
}

TEST(Profile, NoDriftAfterAMillionSeconds) {
  const ProfilePiece pieces[] = {{0.1, 1, 1}, {0.1, 1, 0}};
  Profile profile;
  ASSERT_TRUE(profile.set(0.7044, 0, pieces, 2));
  const LongPoint e = exact(0.7044L, 0, {pieces[0], pieces[1]}, 1e6L);
  // v t = 1.5e5 is one product: its rounding, that of v (1e-17 * 1e6) and of the sum.
  EXPECT_NEAR(profile.at(1e6).position, static_cast<Real>(e.position), 4 * 1.5e5 * kEps);
  EXPECT_EQ(profile.at(1e6).velocity, profile.final_velocity());
}

TEST(Profile, BrakingEndsAtRestExactly) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(5));
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> u(0.001, 30);
  for (int k = 0; k < 10000; ++k) {
    const Real v = u(random), a = u(random);
    const ProfilePiece piece{v / a, -a, -a};
    Profile profile;
    ASSERT_TRUE(profile.set(1, v, &piece, 1));
    ASSERT_EQ(profile.final_velocity(), 0) << "seed " << seed << " case " << k;
    ASSERT_EQ(profile.at(1e9).position, profile.at(profile.end_s()).position);
    ASSERT_FALSE(profile.at_rest_from(0.99 * profile.end_s()));
    ASSERT_TRUE(profile.at_rest_from(profile.end_s()));
  }
}

TEST(Profile, SlowIsNotRest) {
  const ProfilePiece piece{1, -1, -1};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 1 + 1e-12, &piece, 1));
  EXPECT_NEAR(profile.final_velocity(), 1e-12, kEps);
  EXPECT_FALSE(profile.at_rest_from(100));
}

TEST(Profile, AtRestLooksAhead) {
  const ProfilePiece pieces[] = {{1, 0, 0}, {1, 1, -1}, {1, 0, 0}, {1, -1, 1}, {2, 0, 0}};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 0, pieces, 5));
  EXPECT_FALSE(profile.at_rest_from(0.5)) << "a pause is not rest";
  EXPECT_FALSE(profile.at_rest_from(2.5));
  EXPECT_TRUE(profile.at_rest_from(4)) << "a pause that never ends is";
}

TEST(Profile, RebaseMovesTheSamePieces) {
  const std::vector<ProfilePiece> pieces{{0.5, 1, 2}, {0.25, -4, 0}};
  Profile profile;
  ASSERT_TRUE(profile.set(9, 3, pieces.data(), 2));
  ASSERT_TRUE(profile.rebase(-2, 0));
  for (const Real t : {0.0, 0.3, 0.5, 0.6, 0.75, 2.0}) {
    const LongPoint e = exact(-2, 0, pieces, t);
    EXPECT_NEAR(profile.at(t).position, static_cast<Real>(e.position), 8 * kEps);
    EXPECT_NEAR(profile.at(t).velocity, static_cast<Real>(e.velocity), 8 * kEps);
    EXPECT_NEAR(profile.at(t).acceleration, static_cast<Real>(e.acceleration), 8 * kEps);
  }
  EXPECT_FALSE(profile.rebase(kNan, 0));
  EXPECT_FALSE(profile.rebase(0, kInfinity));
  EXPECT_EQ(profile.at(0).position, -2) << "unchanged";
}

TEST(Profile, RefusesNonsenseAndStaysUnchanged) {
  const ProfilePiece good{1, 2, 3};
  Profile profile;
  ASSERT_TRUE(profile.set(1, 2, &good, 1));
  const ProfilePiece bad[] = {{0, 1, 1},
                              {-1, 1, 1},
                              {kNan, 1, 1},
                              {kInfinity, 1, 1},
                              {1, kNan, 1},
                              {1, 1, kInfinity},
                              {1e-320, -1e308, 1e308},
                              {1e300, 1e300, 1}};
  for (const ProfilePiece& piece : bad) {
    const ProfilePiece two[] = {good, piece};
    EXPECT_FALSE(profile.set(0, 0, two, 2)) << piece.duration_s << " " << piece.acceleration_start;
  }
  EXPECT_FALSE(profile.set(kNan, 0, &good, 1));
  EXPECT_FALSE(profile.set(0, -kInfinity, &good, 1));
  EXPECT_FALSE(profile.set(0, 0, &good, -1));
  const std::vector<ProfilePiece> many(kMaxPieces + 1, good);
  EXPECT_FALSE(profile.set(0, 0, many.data(), kMaxPieces + 1));
  EXPECT_TRUE(profile.set(1, 2, many.data(), kMaxPieces));
  ASSERT_TRUE(profile.set(1, 2, &good, 1));
  EXPECT_EQ(profile.at(0).position, 1);
  EXPECT_EQ(profile.at(1).velocity, 4.5);
  EXPECT_TRUE(std::isnan(profile.at(kNan).position));
}

}  // namespace
}  // namespace ballast::firmware
