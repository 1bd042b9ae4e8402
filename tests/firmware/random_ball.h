// Random balls, states and floors for tests of the firmware's model.
#pragma once

#include <cmath>
#include <random>

#include "firmware/model/ball.h"

namespace ballast::firmware::testing {

struct RandomBall {
  BallParams ball;
  Quaternion orientation;  // body -> space, unit
  Vector3 angular_velocity_B_radps;
  MassMotion masses;
};

// Circles and lines, 0 to kMaxMasses masses, values of about 1.
inline RandomBall random_ball(std::mt19937& random, bool slopes, bool resists) {
  std::uniform_real_distribution<Real> u(-1, 1), positive(Real(0.1), 2);
  std::uniform_int_distribution<int> count(0, kMaxMasses);
  const auto vector = [&](Real size) { return Vector3(size * u(random), size * u(random), size * u(random)); };
  RandomBall c;
  c.ball.radius_m = positive(random);
  c.ball.gravity_mps2 = 5 * positive(random);
  c.ball.shell_mass_kg = positive(random);
  c.ball.inertia_kgm2 = Vector3(1, 1, 1) + vector(Real(0.3));
  c.ball.center_of_mass_B_m = vector(Real(0.1));
  c.ball.external_force_W_n = vector(1);
  if (slopes) {
    const Real angle = Real(0.5) * u(random), downhill = 3 * u(random);
    c.ball.down_W =
        Vector3(std::sin(angle) * std::cos(downhill), std::sin(angle) * std::sin(downhill), -std::cos(angle));
  }
  if (resists) {
    c.ball.rolling_resistance = Real(0.05) * positive(random);
    c.ball.spin_friction_m = Real(0.05) * positive(random);
    c.ball.creep_radps = Real(1e-3);
  }
  c.ball.mass_count = count(random);
  for (std::size_t k = 0; k < static_cast<std::size_t>(c.ball.mass_count); ++k) {
    c.ball.mass_kg[k] = positive(random);
    c.ball.rail[k] = k % 2 == 0 ? circle_about(Real(0.9) * c.ball.radius_m, 3 * u(random), Real(1.5) * u(random))
                                : line(vector(Real(0.3)), Vector3(u(random), u(random), Real(1.5)));
    c.masses.position[k] = 3 * u(random);
    c.masses.velocity[k] = 3 * u(random);
    c.masses.acceleration[k] = 3 * u(random);
  }
  c.orientation = Quaternion(u(random), u(random), u(random), u(random)).normalized();
  c.angular_velocity_B_radps = vector(2);
  return c;
}

}  // namespace ballast::firmware::testing
