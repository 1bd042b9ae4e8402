#include "firmware/governor/held_ball.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "firmware/model/rolling.h"
#include "tests/firmware/random_ball.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

// The closed form with masses at rest on their rails is the judge. Rounding of some hundred operations on numbers of
// about 10, times the condition of the 3x3 system.
TEST(HeldBall, EqualsTheClosedFormOnEveryFloor) {
  std::mt19937 random(static_cast<std::uint32_t>(test::random_seed(22)));
  for (int trial = 0; trial < 4000; ++trial) {
    testing::RandomBall c = testing::random_ball(random, trial % 2 == 1, trial % 4 >= 2);
    c.masses.velocity = {};
    c.masses.acceleration = {};
    const HeldBall held = hold_masses(c.ball, c.masses.position);
    const RollingForces mine = held_forces(c.ball, held, c.orientation, c.angular_velocity_B_radps);
    const RollingForces judge = rolling_forces(c.ball, c.orientation, c.angular_velocity_B_radps, c.masses);
    if (std::isnan(judge.normal_force_n)) continue;
    const Real bound =
        1e-12 *
        (10 + std::fabs(judge.normal_force_n) + judge.static_friction_n + judge.angular_acceleration_B_radps2.norm()) *
        10;
    ASSERT_LE(std::fabs(mine.normal_force_n - judge.normal_force_n), bound);
    ASSERT_LE(std::fabs(mine.static_friction_n - judge.static_friction_n), bound);
    ASSERT_LE((mine.angular_acceleration_B_radps2 - judge.angular_acceleration_B_radps2).norm(), bound);
  }
}

// A ball rolled for a long time never accelerates its centre of mass by more than the bound from its start, and never
// needs more of its friction.
TEST(HeldBall, BoundHoldsForEver) {
  std::mt19937 random(static_cast<std::uint32_t>(test::random_seed(22)));
  Real closest = 0;
  for (int trial = 0; trial < 200; ++trial) {
    testing::RandomBall c = testing::random_ball(random, false, false);
    c.ball.external_force_W_n = Vector3::Zero();
    const HeldBall held = hold_masses(c.ball, c.masses.position);
    const Real slow = trial % 2 == 0 ? 1 : 0.1;
    RobotState state;
    state.orientation = c.orientation;
    state.angular_velocity_B_radps = slow * c.angular_velocity_B_radps;
    const ForEver bound = held_for_ever(c.ball, held, state.orientation, state.angular_velocity_B_radps);
    ASSERT_TRUE(bound.known || held.mass_kg == 0);
    const Real weight = held.mass_kg * c.ball.gravity_mps2;
    const Real most = greatest_use(c.ball, held.mass_kg, bound.acceleration_mps2, 1, 0);
    Real seen = 0;
    for (int k = 0; k < 2000; ++k) {
      const RollingForces f = held_forces(c.ball, held, state.orientation, state.angular_velocity_B_radps);
      const Real a = std::hypot(f.static_friction_n, f.normal_force_n - weight) / held.mass_kg;
      seen = std::fmax(seen, a);
      if (f.normal_force_n > 0) {
        ASSERT_LE(f.static_friction_n / f.normal_force_n, most * (1 + 1e-9)) << "trial " << trial;
      }
      step_held(c.ball, held, f, Real(0.02), state);
    }
    // The energy of the Runge-Kutta rule drifts by less than 1e-4 here.
    ASSERT_LE(seen, bound.acceleration_mps2 * (1 + 1e-3)) << "trial " << trial;
    closest = std::fmax(closest, seen / bound.acceleration_mps2);
  }
  std::printf("closest: %.3f of the bound\n", closest);
  EXPECT_GT(closest, 0.2);  // a bound that is never approached would be of no use
}

TEST(HeldBall, BoundIsUnknownOnOtherFloors) {
  std::mt19937 random(1);
  for (const bool slopes : {false, true}) {
    testing::RandomBall c = testing::random_ball(random, slopes, !slopes);
    const HeldBall held = hold_masses(c.ball, c.masses.position);
    EXPECT_FALSE(held_for_ever(c.ball, held, c.orientation, c.angular_velocity_B_radps).known);
  }
}

TEST(HeldBall, GreatestUseIsReached) {
  BallParams ball;
  ball.gravity_mps2 = 10;
  // a at the angle b with sin b = a / g: f = a cos b, N = g - a sin b.
  const Real a = 3, sine = a / 10, cosine = std::sqrt(1 - sine * sine);
  EXPECT_NEAR(greatest_use(ball, 1, a, 0.5, 0), a * cosine / (10 - a * sine) / 0.5, 1e-14);
  EXPECT_TRUE(std::isinf(greatest_use(ball, 2, a, 0.5, 15)));  // N could be 14
}

}  // namespace
}  // namespace ballast::firmware
