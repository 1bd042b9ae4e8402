#include "tools/soak/bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ballast::soak {

double longest_stop_s(const sim::Scenario& scenario, const double* velocity, const double* acceleration) {
  double longest_s = 0;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Motor& motor = scenario.masses[i].motor;
    const double jerk = motor.max_jerk, most = motor.max_acceleration, a = std::abs(acceleration[i]);
    const double speed = std::abs(velocity[i]) + a * a / (2 * jerk);
    const double down_s = speed * jerk <= most * most ? 2 * std::sqrt(speed / jerk) : speed / most + most / jerk;
    longest_s = std::max(longest_s, a / jerk + down_s);
  }
  return longest_s;
}

namespace {

double weight_n(const sim::Scenario& scenario) {
  double mass_kg = scenario.ball.mass_kg;
  for (const sim::Mass& mass : scenario.masses) mass_kg += mass.mass_kg;
  return mass_kg * scenario.gravity_mps2;
}

}  // namespace

double disagreement_limit_n(const sim::Scenario& scenario) {
  const double pressing_n = std::max(weight_n(scenario), scenario.external_force_W_n.norm());
  return pressing_n > 0 ? 0.05 * pressing_n : std::numeric_limits<double>::infinity();
}

double rounding_n(const sim::Scenario& scenario, double normal_n, double friction_n, const double* velocity,
                  const double* acceleration) {
  double greatest_n = weight_n(scenario) + std::abs(normal_n) + friction_n + scenario.external_force_W_n.norm();
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Mass& mass = scenario.masses[i];
    const double to_m = mass.metres_per_rail_unit(), speed_mps = to_m * velocity[i];
    greatest_n += mass.mass_kg * (to_m * std::abs(acceleration[i]) + speed_mps * speed_mps / scenario.ball.radius_m);
  }
  return 1e-9 * greatest_n;
}

}  // namespace ballast::soak
