// Motions that are commanded tick by tick keep the motor's limits and the rail's ends, whatever is wanted.
#include "firmware/motion/tick_motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "firmware/motion/motion_limits.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

constexpr Wide kEndless = std::numeric_limits<Wide>::infinity();
constexpr Wide kPeriod = 0.001;

// A mass that is moved tick by tick, and the extremes of its motion.
class Mass {
 public:
  Mass(const MotionLimits& limits, Wide lowest, Wide highest, const ProfilePoint& start)
      : limits_(limits), lowest_(lowest), highest_(highest), now_(start) {}

  void step(Wide wanted) {
    const Wide a = reachable_acceleration(now_, wanted, limits_, lowest_, highest_, kPeriod);
    ASSERT_TRUE(set_tick_motion(now_, a, kPeriod, profile_));
    // The tick alone: beyond it the profile is a guess. Rounding of 1e-9 of a limit passes, as everywhere.
    const ProfilePiece tick{kPeriod, now_.acceleration, a};
    Profile alone;
    ASSERT_TRUE(alone.set(now_.position, now_.velocity, &tick, 1));
    const LimitBreach breach = check_limits(alone, limits_);
    EXPECT_TRUE(breach.ok()) << "limit " << static_cast<int>(breach.what) << " by " << breach.value << ": v "
                             << now_.velocity << ", a " << now_.acceleration << " to " << a << " of "
                             << limits_.max_velocity << ", " << limits_.max_acceleration << ", " << limits_.max_jerk;
    const ProfilePoint next = profile_.at(kPeriod);
    EXPECT_EQ(next.acceleration, a);
    now_ = next;
    low = std::min(low, now_.position);
    high = std::max(high, now_.position);
    fastest = std::max(fastest, std::fabs(now_.velocity));
  }
  [[nodiscard]] const ProfilePoint& now() const { return now_; }

  Wide low = kEndless, high = -kEndless, fastest = 0;

 private:
  MotionLimits limits_;
  Wide lowest_, highest_;
  ProfilePoint now_;
  Profile profile_;
};

TEST(TickMotion, TakesWhatIsWantedInsideTheLimits) {
  const MotionLimits limits{10, 100, 1e4};
  const ProfilePoint from{0, 1, 2};
  EXPECT_EQ(reachable_acceleration(from, 5, limits, -kEndless, kEndless, kPeriod), 5);
  EXPECT_EQ(reachable_acceleration(from, 5, limits, -1, 1, kPeriod), 5);
  EXPECT_EQ(reachable_acceleration(from, 50, limits, -kEndless, kEndless, kPeriod), 12) << "jerk";
  EXPECT_EQ(reachable_acceleration(from, -50, limits, -kEndless, kEndless, kPeriod), -8);
  EXPECT_EQ(reachable_acceleration({0, 0, 99}, 150, limits, -kEndless, kEndless, kPeriod), 100) << "acceleration";
  EXPECT_EQ(reachable_acceleration(from, std::numeric_limits<Wide>::quiet_NaN(), limits, -kEndless, kEndless, kPeriod),
            0);
}

// Jumps of the wanted acceleration to any size, at any time.
TEST(TickMotion, NeverPassesALimit) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  const auto log_uniform = [&](Wide low, Wide high) {
    return low * std::pow(high / low, std::uniform_real_distribution<Wide>(0, 1)(random));
  };
  for (int round = 0; round < 200; ++round) {
    const MotionLimits limits{log_uniform(0.01, 10), log_uniform(0.1, 100), log_uniform(1, 1e5)};
    const bool ends = round % 2 == 0;
    // From rest to the greatest speed at the limits takes about this long a way.
    const Wide way = limits.max_velocity *
                     (limits.max_velocity / limits.max_acceleration + limits.max_acceleration / limits.max_jerk);
    const Wide room = way * log_uniform(0.01, 10);
    Wide end = kEndless;
    if (ends) end = room;
    Mass mass(limits, -end, end, {0, 0, 0});
    Wide wanted = 0;
    int left = 0;
    for (int k = 0; k < 3000 && !::testing::Test::HasFailure(); ++k) {
      if (left-- == 0) {
        left = static_cast<int>(log_uniform(1, 1000));
        wanted = (random() % 2 == 0 ? 1 : -1) * limits.max_acceleration * log_uniform(0.01, 10);
        if (random() % 4 == 0) wanted = 0;
      }
      mass.step(wanted);
    }
    if (!ends) continue;
    constexpr Wide kRounding = 1e-12;  // of thousands of ticks
    EXPECT_GE(mass.low, -room * (1 + kRounding)) << "round " << round;
    EXPECT_LE(mass.high, room * (1 + kRounding)) << "round " << round;
    if (::testing::Test::HasFailure()) return;
  }
}

TEST(TickMotion, ReachesTheSpeedAndTheEnd) {
  const MotionLimits limits{0.5, 10, 1000};
  Mass free(limits, -kEndless, kEndless, {0, 0, 0});
  for (int k = 0; k < 1000; ++k) free.step(10);
  EXPECT_NEAR(free.now().velocity, 0.5, 1e-5);  // the slack of 1e-6, approached over many ticks
  Mass ended(limits, -1, 1, {0, 0, 0});
  for (int k = 0; k < 5000; ++k) ended.step(10);
  EXPECT_NEAR(ended.now().position, 1, 1e-6);  // approached with the time constant of 24 ticks
  EXPECT_NEAR(ended.now().velocity, 0, 1e-6);
  // A mass at its stop leaves it, and goes no further.
  Mass outside(limits, -1, 1, {1.01, 0, 0});
  for (int k = 0; k < 100; ++k) outside.step(10);
  EXPECT_LE(outside.high, 1.01 + 1e-9);
  for (int k = 0; k < 1000; ++k) outside.step(-10);
  EXPECT_LT(outside.now().position, 1);
}

// A tick's profile goes on for a tick with the same acceleration: what looks beyond the border finds it.
TEST(TickMotion, ProfileGoesOnForATick) {
  Profile profile;
  ASSERT_TRUE(set_tick_motion({1, 2, 3}, 5, kPeriod, profile));
  EXPECT_EQ(profile.at(0).position, 1);
  EXPECT_EQ(profile.at(0).velocity, 2);
  EXPECT_EQ(profile.at(0).acceleration, 3);
  EXPECT_EQ(profile.at(kPeriod).acceleration, 5);
  EXPECT_NEAR(profile.at(kPeriod).velocity, 2 + 4 * kPeriod, 1e-15);
  EXPECT_EQ(profile.at(1.5 * kPeriod).acceleration, 5);
  const Profile before = profile;
  EXPECT_FALSE(set_tick_motion({1, 2, 3}, std::numeric_limits<Wide>::quiet_NaN(), kPeriod, profile));
  EXPECT_EQ(profile.at(kPeriod).velocity, before.at(kPeriod).velocity);
}

}  // namespace
}  // namespace ballast::firmware
