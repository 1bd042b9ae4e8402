#include "firmware/governor/motor_allowance.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "firmware/governor/backup.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

// Rotor and mass in the field of a stepper with microsteps, a detent torque and a fixed error of every full step, led
// at a constant speed. Returns the greatest acceleration once the start has died away.
double greatest_acceleration(const MotorSwing& swing, double velocity, std::mt19937& random) {
  constexpr int kFullSteps = 200;
  std::uniform_real_distribution<double> error(-1, 1);
  double pattern[kFullSteps];
  for (double& e : pattern) e = swing.step_error * swing.full_step * error(random);
  const double w = swing.natural_radps, damping = 2 * swing.damping_ratio * w;
  const double die_s = 8 / (swing.damping_ratio * w);
  const double steps_s = swing.microstep / velocity;
  const double h = std::fmin(0.02 / w, steps_s / 8);
  double x = 0, v = velocity, most = 0;
  const auto field = [&](double t) {
    const double at = velocity * t, full = at / swing.full_step;
    const auto k = static_cast<long>(std::floor(full));
    const double between = pattern[k % kFullSteps] +
                           (full - static_cast<double>(k)) * (pattern[(k + 1) % kFullSteps] - pattern[k % kFullSteps]);
    return std::round(at / swing.microstep) * swing.microstep + between;
  };
  // The viscous part is constant at a constant speed; only its change is a swing.
  const auto rate = [&](double t, double xx, double vv) {
    const double detent = swing.detent * std::sin(2 * std::numbers::pi * xx / swing.full_step);
    return w * w * (field(t) - xx) - detent - damping * (vv - velocity);
  };
  const double end_s = die_s + 20 * swing.full_step / velocity;
  for (double t = 0; t < end_s; t += h) {
    const double a = rate(t, x, v), vm = v + h / 2 * a, am = rate(t + h / 2, x + h / 2 * v, vm);
    if (t > die_s) most = std::fmax(most, std::fabs(a));
    x += h * vm;
    v += h * am;
  }
  return most;
}

// paper_ball's motors: stiffness 50 * 12, inertia 5 + 0.9, damping 30.
TEST(MotorAllowance, BoundsASwingingRotorAtASteadySpeed) {
  std::mt19937 random(static_cast<std::uint32_t>(test::random_seed(22)));
  MotorSwing swing;
  swing.natural_radps = std::sqrt(Real(600) / Real(5.9));
  swing.damping_ratio = 30 / (2 * std::sqrt(Real(600) * Real(5.9)));
  swing.full_step = std::numbers::pi_v<Real> / 100;
  swing.microstep = swing.full_step / 16;
  swing.step_error = Real(0.015);
  double closest = 0;
  // Detent torques up to a tenth of the holding torque, which is the field's at a full step.
  for (const double detent : {0.0, 0.05, 0.1}) {
    swing.detent = static_cast<Real>(detent * 12 / 5.9);
    for (const double velocity : {0.02, 0.05, 0.1, 0.15, 0.3, 1.0}) {
      const double bound = acceleration_error(swing, static_cast<Real>(velocity));
      for (int k = 0; k < 10; ++k) {
        const double seen = greatest_acceleration(swing, velocity, random);
        EXPECT_LE(seen, bound) << velocity << " with a detent torque of " << detent;
        closest = std::fmax(closest, seen / bound);
      }
    }
  }
  std::printf("closest: %.3f of the bound\n", closest);
  EXPECT_GT(closest, 0.5);
}

// A mass that is slowing down may pass the resonance of its microsteps, and of its full steps.
TEST(MotorAllowance, BoundsAMassThatSlowsDown) {
  std::mt19937 random(static_cast<std::uint32_t>(test::random_seed(22)));
  std::uniform_real_distribution<Real> size(Real(0.01), 1);
  for (int k = 0; k < 200; ++k) {
    MotorSwing swing{10 * size(random), size(random), 0, Real(0.03) * size(random), Real(0.02) * size(random)};
    swing.microstep = swing.full_step / 16;
    swing.detent = size(random);
    const Real from = 2 * size(random) * swing.natural_radps * swing.full_step;
    Real greatest = 0;
    for (int i = 1; i <= 2000; ++i) {
      greatest = std::fmax(greatest, acceleration_error(swing, from * static_cast<Real>(i) / 2000));
    }
    const Real bound = acceleration_error(swing, from, true);
    EXPECT_GE(bound * (1 + Real(1e-5)), greatest);
    EXPECT_LE(bound, 2 * greatest);  // both resonances may not be at one speed
  }
}

TEST(MotorAllowance, IsNothingForIdealMassesAndAtRest) {
  EXPECT_EQ(acceleration_error({}, 1), 0);
  EXPECT_EQ(acceleration_error({10, Real(0.2), Real(0.01), Real(0.1), Real(0.015)}, 0), 0);
  // Rounding leaves this of a stopped mass's speed.
  EXPECT_EQ(acceleration_error({10, Real(0.2), Real(0.01), Real(0.1), Real(0.015)}, Real(1e-12)), 0);
}

// A rotor whose field goes on at a steady speed, with the damping of its bearings: x'' = w^2 (v t - x) - 2 zeta w x'.
TEST(MotorAllowance, AMovingMassIsBehindItsCommand) {
  GovernorParams params;
  params.mass[0].max_acceleration = 1;
  params.mass[0].swing.natural_radps = 10;
  params.mass[0].swing.damping_ratio = Real(0.25);
  BallParams ball;
  ball.radius_m = ball.gravity_mps2 = 1;
  set_times(ball, Wide{0.001}, params);
  const Real v = Real(0.3), h = Real(1e-4);
  Real x = 0, speed = 0, t = 0;
  for (int k = 0; k < 100000; ++k) {
    speed += h * (100 * (v * t - x) - 5 * speed);
    x += h * speed;
    t += h;
  }
  RobotState state;
  state.mass_position[0] = v * t;
  state.mass_velocity[0] = v;
  // The step's own error is half of h v.
  EXPECT_NEAR(lagging(params, state).position[0], x, h * v);
  EXPECT_EQ(lagging(params, state).velocity[0], v);
}

}  // namespace
}  // namespace ballast::firmware
