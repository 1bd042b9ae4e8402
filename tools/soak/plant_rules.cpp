#include "tools/soak/plant_rules.h"

#include <fmt/core.h>

#include <Eigen/Geometry>
#include <cmath>

namespace ballast::soak {

namespace {

using sim::Regime;

// Part of the greater of two numbers that come from the same state by different code: some roundings.
constexpr double kRounding = 1e-9;

std::int8_t code_of(Regime regime) {
  switch (regime) {
    case Regime::kRolling:
      return contact_t::REGIME_ROLLING;
    case Regime::kSliding:
      return contact_t::REGIME_SLIDING;
    case Regime::kFlight:
      return contact_t::REGIME_FLIGHT;
  }
  return -1;
}

std::string rolling_error(const sim::Scenario& scenario, const sim::Plant::Sample& truth) {
  const auto& q = truth.orientation;
  const Eigen::Vector3d omega_W = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * truth.angular_velocity_B_radps;
  const double radius_m = scenario.ball.radius_m;
  const Eigen::Vector3d due_mps = radius_m * omega_W.cross(Eigen::Vector3d::UnitZ());
  const double slip_mps = (truth.velocity_W_mps - due_mps).norm();
  if (slip_mps <= kRounding * radius_m * omega_W.norm()) return "";
  return fmt::format("the ball is said to roll, and its contact point moves at {:g} m/s", slip_mps);
}

}  // namespace

int switches_due(const sim::Scenario& scenario, const sim::Plant::Sample& truth, std::size_t i) {
  const firmware::Rail& rail = scenario.masses[i].rail;
  const double position = truth.mass_position[i];
  return (position <= rail.lower_end ? 1 : 0) + (position >= rail.upper_end ? 2 : 0);
}

bool driven_over_an_end(const sensors_t& sensors, const controller_status_t& status) {
  for (int i = 0; i < status.motor_count; ++i) {
    const double velocity = status.commanded_velocity[i];
    const bool at_lower = (sensors.limit_switch[i] & 1) != 0, at_upper = (sensors.limit_switch[i] & 2) != 0;
    if ((at_lower && velocity < 0) || (at_upper && velocity > 0)) return true;
  }
  return false;
}

std::string regime_error(const sim::Scenario& scenario, const contact_t& contact, const sim::Plant::Sample& truth) {
  if (contact.regime != code_of(truth.regime)) {
    return fmt::format("the contact message says regime {} where the plant is in {}", contact.regime,
                       code_of(truth.regime));
  }
  if (contact.last != 0) return "";
  const double friction_n = truth.friction_force_W_n.norm();
  if (truth.regime == Regime::kFlight) {
    if (truth.normal_force_n == 0 && friction_n == 0) return "";
    return fmt::format("the ball flies, and the floor pushes it with N = {:g} N, f = {:g} N", truth.normal_force_n,
                       friction_n);
  }
  const double most_n = truth.floor_static_friction * truth.normal_force_n;
  if (std::isfinite(most_n) && friction_n > most_n * (1 + kRounding)) {
    return fmt::format("the floor gives f = {:g} N where it has mu_s N = {:g} N", friction_n, most_n);
  }
  return truth.regime == Regime::kRolling ? rolling_error(scenario, truth) : "";
}

}  // namespace ballast::soak
