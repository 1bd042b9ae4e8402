#include "tools/soak/bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "firmware/motion/step_command.h"

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

bool overload_possible(const sim::Scenario& scenario, const controller_status_t& status) {
  const int count = static_cast<int>(scenario.masses.size());
  if (status.overload_motor < 0 || status.overload_motor >= count) return false;
  if (status.overload_tick != status.tick + 1 || !(status.overload_value > status.overload_limit)) return false;
  const sim::Motor& motor = scenario.masses[static_cast<std::size_t>(status.overload_motor)].motor;
  const double period_s = scenario.run.control_period_s, per_unit = motor.microsteps_per_rail_unit();
  const double speed = std::abs(status.next_velocity[status.overload_motor]);
  const double change = motor.max_acceleration * period_s;
  const double greatest_hz = (speed + change) * per_unit;
  const double most_steps = greatest_hz * period_s + 1;
  const auto limit_is = [&status](double due) { return status.overload_limit == due; };
  switch (status.overload_error) {
    case controller_status_t::OVERLOAD_TOO_MANY_STEPS:
      return limit_is(firmware::kMaxStepsPerTick) && most_steps > firmware::kMaxStepsPerTick;
    case controller_status_t::OVERLOAD_TOO_MANY_BURSTS:
      return limit_is(firmware::bursts_per_motor(count)) && most_steps > status.overload_limit;
    case controller_status_t::OVERLOAD_TOO_FAST:
      return limit_is(motor.max_step_rate_hz) && (greatest_hz > motor.max_step_rate_hz || speed <= change);
    default:
      return false;
  }
}

namespace {

// As it is believed.
double weight_n(const sim::Scenario& scenario) {
  double mass_kg = scenario.belief().ball.mass_kg;
  for (const sim::Mass& mass : scenario.belief().masses) mass_kg += mass.mass_kg;
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
