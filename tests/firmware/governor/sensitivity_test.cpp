#include "firmware/governor/sensitivity.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "firmware/governor/backup.h"
#include "firmware/governor/turning.h"
#include "firmware/model/rolling.h"
#include "tests/firmware/paper_ball.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

// All errors at once, at random inside their bounds: what they add to f_s - kappa N stays below the share, to first
// order, where they turn the friction by little. Second-order terms are below a tenth of the first.
TEST(Sensitivity, BoundsWhatErrorsAdd) {
  std::mt19937 random(static_cast<std::uint32_t>(test::random_seed(22)));
  std::uniform_real_distribution<Real> u(-1, 1);
  const BallParams ball = testing::paper_ball();
  const StateErrors errors{Real(0.002), Real(0.002)};
  constexpr Real kFriction = Real(0.3);
  Real closest = 0;
  for (int trial = 0; trial < 300; ++trial) {
    RobotState state;
    state.orientation = Quaternion(u(random), u(random), u(random), u(random)).normalized();
    state.angular_velocity_B_radps = Vector3(u(random), u(random), u(random));
    PerMass<Real> acceleration{};
    for (std::size_t i = 0; i < 3; ++i) {
      state.mass_position[i] = 3 * u(random);
      state.mass_velocity[i] = Real(0.3) * u(random);
      acceleration[i] = Real(0.3) * u(random);
    }
    MassMotion masses = motion_of(state);
    masses.acceleration = acceleration;
    const RollingForces here = rolling_forces(ball, state.orientation, state.angular_velocity_B_radps, masses);
    if (!(here.normal_force_n > 0.5 && here.static_friction_n > 0.1 * here.normal_force_n)) continue;
    Sensitivity sensitivity;
    for (int k = 0; k < 5; ++k) sensitivity.advance(ball, kFriction, state, acceleration, errors);
    const Real bound = sensitivity.share() * here.normal_force_n;
    for (int k = 0; k < 50; ++k) {
      const Eigen::AngleAxis<Real> tilt(errors.tilt_rad, Vector3(u(random), u(random), 0).normalized());
      Vector3 omega = state.angular_velocity_B_radps;
      for (int j = 0; j < 3; ++j) omega[j] += std::copysign(errors.omega_radps, u(random));
      const RollingForces there = rolling_forces(ball, tilt * state.orientation, omega, masses);
      const Real added = there.static_friction_n - kFriction * there.normal_force_n - here.static_friction_n +
                         kFriction * here.normal_force_n;
      ASSERT_LE(added, bound * Real(1.1)) << "trial " << trial;
      closest = std::fmax(closest, added / bound);
    }
  }
  std::printf("closest: %.3f of the bound\n", closest);
  EXPECT_GT(closest, 0.5);
}

TEST(Sensitivity, IsNothingWithoutErrors) {
  Sensitivity sensitivity;
  for (int k = 0; k < 30; ++k) sensitivity.advance(testing::paper_ball(), Real(0.3), {}, {}, {});
  EXPECT_EQ(sensitivity.share(), 0);
}

}  // namespace
}  // namespace ballast::firmware
