#include "firmware/governor/belief.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "firmware/governor/governor.h"
#include "firmware/model/rolling.h"
#include "tests/firmware/corner_ball.h"
#include "tests/firmware/paper_ball.h"
#include "tests/firmware/random_ball.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

Real use_of(const RollingForces& f) { return f.static_friction_n / f.normal_force_n; }

// Errors at corners of their bounds change f_s / N in one state. The bound is of first order: of errors of half a
// per cent the second is below 1 % of it.
TEST(Belief, BoundsWhatErrorsAddAtAState) {
  std::mt19937 random(static_cast<std::uint32_t>(test::random_seed(22)));
  Real closest = 0;
  int tried = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    testing::RandomBall c = testing::random_ball(random, trial % 2 == 1, trial % 4 >= 2);
    c.angular_velocity_B_radps *= Real(0.2);
    for (std::size_t i = 0; i < kMaxMasses; ++i)
      c.masses.velocity[i] *= Real(0.1), c.masses.acceleration[i] *= Real(0.1);
    const BeliefErrors errors{Real(0.005), Real(0.0005) * c.ball.radius_m};
    const RollingForces here = rolling_forces(c.ball, c.orientation, c.angular_velocity_B_radps, c.masses);
    if (!(use_of(here) < 1 && here.normal_force_n > Real(0.2) * c.ball.shell_mass_kg * c.ball.gravity_mps2)) continue;
    ++tried;
    Drift drift;
    drift_of(c.ball, errors, arms_of(c.ball, c.masses, c.angular_velocity_B_radps), c.orientation,
             c.angular_velocity_B_radps, here, drift);
    const Real bound = drift.force_n() / here.normal_force_n;
    for (int k = 0; k < 20; ++k) {
      const BallParams truth = testing::corner_ball(c.ball, errors, random);
      const Real added =
          use_of(rolling_forces(truth, c.orientation, c.angular_velocity_B_radps, c.masses)) - use_of(here);
      ASSERT_LE(added, Real(1.01) * bound) << "trial " << trial;
      closest = std::fmax(closest, added / bound);
    }
  }
  std::printf("%d states; closest: %.3f of the bound\n", tried, closest);
  EXPECT_GT(tried, 500);
  EXPECT_GT(closest, 0.5);
}

// A ball with a pendulum's equations: the masses hang still, one error pushes. At w = sqrt(-stiffness) it swings
// between 0 and 2 push / w^2; where the stiffness is the other way it grows as cosh(w t) - 1.
TEST(Belief, SwingsAndFalls) {
  for (const Real sign : {Real(-1), Real(1)}) {
    Drift drift;
    drift.errors = 1;
    drift.stiffness_per_s2 = sign * Real(0.25);
    drift.pushes_radps2[0] = {Real(0.01), 0};
    Astray astray;
    const Real h = Real(1e-3);
    for (int step = 1; step <= 6000; ++step) {
      astray.advance(drift, h);
      const Real x = Real(0.5) * h * static_cast<Real>(step);
      const Real tilt = Real(0.04) * (sign < 0 ? 1 - std::cos(x) : std::cosh(x) - 1);
      // One step of the first order is off by h in time, whose part of the tilt's rate is below .02 sinh(3).
      ASSERT_NEAR(astray.tilt_rad(drift), std::fabs(tilt), Real(0.02) * 11 * h) << step;
    }
  }
}

// All masses and the inertia heavier by the same part: without an outside force nothing changes, and the pushes cancel.
TEST(Belief, MassesThatAreAllHeavierRollAlike) {
  std::mt19937 random(static_cast<std::uint32_t>(test::random_seed(22)));
  for (int trial = 0; trial < 300; ++trial) {
    testing::RandomBall c = testing::random_ball(random, trial % 2 == 1, false);
    Drift drift;
    c.ball.external_force_W_n = Vector3::Zero();
    const RollingForces free = rolling_forces(c.ball, c.orientation, c.angular_velocity_B_radps, c.masses);
    drift_of(c.ball, {1, 0}, arms_of(c.ball, c.masses, c.angular_velocity_B_radps), c.orientation,
             c.angular_velocity_B_radps, free, drift);
    Horizontal all;
    Real size = 0;
    for (std::size_t j = kFirstInertiaError; j < static_cast<std::size_t>(drift.errors); ++j) {
      all.x += drift.pushes_radps2[j].x;
      all.y += drift.pushes_radps2[j].y;
      size += std::hypot(drift.pushes_radps2[j].x, drift.pushes_radps2[j].y);
    }
    ASSERT_LE(std::hypot(all.x, all.y), 1e-12 * (1 + size)) << "trial " << trial;
  }
}

// A turn about the vertical takes the tilt along: its length is that of a ball that does not turn.
TEST(Belief, TurnsWithTheBall) {
  Drift drift;
  drift.errors = 1;
  drift.pushes_radps2[0] = {Real(0.01), 0};
  Astray astray;
  for (int step = 0; step < 1000; ++step) astray.advance(drift, Real(1e-3));
  const Real before = astray.tilt_rad(drift);
  drift.pushes_radps2[0] = {};
  drift.spin_radps = 3;
  Astray still = astray;
  for (int step = 0; step < 10; ++step) astray.advance(drift, Real(1e-4));
  drift.spin_radps = 0;
  for (int step = 0; step < 10; ++step) still.advance(drift, Real(1e-4));
  EXPECT_NEAR(astray.tilt_rad(drift), still.tilt_rad(drift), Real(1e-3) * before);
  EXPECT_EQ(astray.omega_radps(drift), still.omega_radps(drift));
}

// A true ball with errors at corners of their bounds, held from a state that is off by the errors of the state, keeps
// the bound that is known of the believed one.
TEST(Belief, HeldForEverHoldsForTheTrueBall) {
  std::mt19937 random(static_cast<std::uint32_t>(test::random_seed(22)));
  std::uniform_real_distribution<Real> u(-1, 1);
  Real closest = 0;
  for (int trial = 0; trial < 200; ++trial) {
    testing::RandomBall c = testing::random_ball(random, false, false);
    c.ball.external_force_W_n = Vector3::Zero();
    const Real size = trial % 2 == 0 ? 1 : Real(0.2);
    const Vector3 omega = (trial % 4 < 2 ? 1 : Real(0.1)) * c.angular_velocity_B_radps;
    const BeliefErrors errors{size * Real(0.05), size * Real(0.005) * c.ball.radius_m};
    c.masses.velocity = {};
    c.masses.acceleration = {};
    const HeldBall believed = hold_masses(c.ball, c.masses.position);
    const RollingForces here = held_forces(c.ball, believed, c.orientation, omega);
    Drift drift;
    drift_of(c.ball, errors, arms_of(c.ball, c.masses, omega), c.orientation, omega, here, drift);
    HeldErrors off = held_errors(c.ball, errors, arms_of(c.ball, c.masses, omega), drift, {});
    off.omega_radps = off.tilt_rad = size * Real(0.1);
    const ForEver bound = held_for_ever(c.ball, believed, c.orientation, omega, off);
    if (!bound.known) continue;
    const BallParams truth = testing::corner_ball(c.ball, errors, random);
    const HeldBall held = hold_masses(truth, c.masses.position);
    const Real weight = held.mass_kg * truth.gravity_mps2;
    RobotState state;
    state.orientation =
        Eigen::AngleAxis<Real>(off.tilt_rad, Vector3(u(random), u(random), 0).normalized()) * c.orientation;
    const Vector3 omega_W =
        c.orientation * omega + off.omega_radps * Vector3(u(random), u(random), u(random)).normalized();
    state.angular_velocity_B_radps = state.orientation.conjugate() * omega_W;
    Real seen = 0;
    for (int k = 0; k < 2000; ++k) {
      const RollingForces f = held_forces(truth, held, state.orientation, state.angular_velocity_B_radps);
      seen = std::fmax(seen, std::hypot(f.static_friction_n, f.normal_force_n - weight) / held.mass_kg);
      step_held(truth, held, f, Real(0.02), state);
    }
    ASSERT_LE(seen, bound.acceleration_mps2 * (1 + Real(1e-3))) << "trial " << trial;
    closest = std::fmax(closest, seen / bound.acceleration_mps2);
  }
  std::printf("closest: %.3f of the bound\n", closest);
  EXPECT_GT(closest, 0.2);
}

// The cone of a ramp keeps free what it is told to, of the friction and of N.
TEST(Belief, IsKeptFreeInTheCone) {
  const BallParams ball = testing::paper_ball();
  GovernorParams params;
  params.friction = 1;
  for (std::size_t i = 0; i < 3; ++i) params.mass[i].max_acceleration = 1;
  set_times(ball, 0.001, params);
  RobotState state;
  state.orientation = Quaternion::Identity();
  Ramp ramp;
  ramp.h_s = Real(0.001);
  ramp.end = {{-1, -1, -1}, {1, 1, 1}};
  params.belief_error.mass_share = Real(0.02);  // lighter by that, N has less besides
  params.min_normal_force_n = Real(0.3);
  GovernedRamp free, kept;
  const AffineForces forces = forces_at(ball, params, state);
  governed_for_ramp(ball, params, state, forces, ramp, {}, free);
  ramp.belief_n = Real(0.1);
  governed_for_ramp(ball, params, state, forces, ramp, {}, kept);
  EXPECT_DOUBLE_EQ(kept.cone.slack_n, free.cone.slack_n + Real(0.1));
  EXPECT_DOUBLE_EQ(kept.cone.min_normal_force_n, Real(0.4 / 0.98));
  EXPECT_DOUBLE_EQ(allowance_of(params, kept, 3), allowance_of(params, free, 3) + Real(0.1) / kept.force_W_n[2]);
}

// At rest at an attitude where it is balanced.
RobotState balanced(const BallParams& ball, bool on_its_head) {
  RobotState state;
  const HeldBall held = hold_masses(ball, state.mass_position);
  const Vector3 up = held.moment_B_kgm.normalized() * (on_its_head ? 1 : -1);
  state.orientation = Quaternion::FromTwoVectors(up, Vector3::UnitZ());
  return state;
}

// Declared errors are kept free of the friction in a tick, too, and its status says how much.
TEST(Belief, IsKeptFreeInTheTick) {
  const BallParams ball = testing::paper_ball();
  GovernorParams params;
  params.friction = Real(0.05);
  for (std::size_t i = 0; i < 3; ++i) params.mass[i].max_acceleration = 1;
  set_times(ball, 0.001, params);
  GovernorState state;
  reset(state);
  state.mode = GovernorMode::kNominal;
  const RobotState now = balanced(ball, false);
  const NominalEnd nominal{{1, 1, 1}, {1, 1, 1}};
  Ramp ramp;
  ramp.h_s = Real(0.001);
  ramp.end = {{-1, -1, -1}, {1, 1, 1}};
  const auto commanded = [&](Real share) {
    params.belief_error.mass_share = share;
    GovernorOutput out;
    detail::command(ball, params, state, now, ramp, nominal, 0, out);
    return out;
  };
  const GovernorOutput free = commanded(0), kept = commanded(Real(0.02));
  EXPECT_TRUE(free.report.bent);
  EXPECT_GT(free.report.use, 0.98);
  const Real declared = kept.report.allowance - free.report.allowance;
  EXPECT_GT(declared, 1e-3);
  EXPECT_NEAR(kept.report.use, free.report.use - declared / params.friction, 1e-3);
}

// How a rollout ends that brakes the paper's ball at once.
RolloutEnd end_of_brake(bool on_its_head, Real friction, const BeliefErrors& errors, Real min_normal_force_n = 0) {
  const BallParams ball = testing::paper_ball();
  GovernorParams params;
  params.friction = friction;
  params.min_normal_force_n = min_normal_force_n;
  params.belief_error = errors;
  for (std::size_t i = 0; i < 3; ++i) params.mass[i].max_acceleration = 1;
  set_times(ball, 0.001, params);
  Rollout rollout;
  rollout.begin(params, balanced(ball, on_its_head), 0, {});
  Bends none;
  none.clear(0, {});
  const auto nominal = [](Wide, const RobotState&) { return Wish{}; };
  for (int step = 0; step < 2000 && rollout.end() == RolloutEnd::kUnderWay; ++step) {
    rollout.advance(ball, params, nominal, none, 1);
  }
  return rollout.end();
}

// A ball that stands on its head does so for a horizon, or for as long as its errors let it.
TEST(Belief, RefusesABallThatMayFallOver) {
  EXPECT_EQ(end_of_brake(true, Real(0.3), {}), RolloutEnd::kHorizon);
  EXPECT_EQ(end_of_brake(true, Real(0.3), {Real(1e-4), 0}), RolloutEnd::kHorizon);
  EXPECT_EQ(end_of_brake(true, Real(0.3), {Real(0.05), 0}), RolloutEnd::kBroken);
  EXPECT_EQ(end_of_brake(true, Real(0.3), {0, Real(0.03)}), RolloutEnd::kBroken);
}

// A ball that hangs is held for ever where its energy, or that of the worst true ball, is too small to break the cone;
// else it swings through the horizon inside of it, or the swing of the true one leaves it.
TEST(Belief, HoldsAHangingBall) {
  EXPECT_EQ(end_of_brake(false, Real(0.01), {}), RolloutEnd::kForEver);
  EXPECT_EQ(end_of_brake(false, Real(0.3), {Real(0.01), 0}), RolloutEnd::kForEver);
  EXPECT_EQ(end_of_brake(false, Real(0.04), {Real(0.02), 0}), RolloutEnd::kHorizon);
  EXPECT_EQ(end_of_brake(false, Real(0.006), {Real(0.02), 0}), RolloutEnd::kBroken);
}

// The ball weighs 4 N. One that may be 3 % lighter does not keep 3.9 N.
TEST(Belief, KeepsTheNormalForceOfALightRobot) {
  EXPECT_NE(end_of_brake(false, Real(0.3), {}, Real(3.9)), RolloutEnd::kBroken);
  EXPECT_NE(end_of_brake(false, Real(0.3), {Real(0.005), 0}, Real(3.9)), RolloutEnd::kBroken);
  EXPECT_EQ(end_of_brake(false, Real(0.3), {Real(0.03), 0}, Real(3.9)), RolloutEnd::kBroken);
}

}  // namespace
}  // namespace ballast::firmware
