#include "tests/physics/mechanics.h"

#include <cmath>
#include <vector>

namespace ballast::test {

using Eigen::Vector3d;

Eigen::Quaterniond attitude(const sim::Plant::Sample& p) {
  return {p.orientation[0], p.orientation[1], p.orientation[2], p.orientation[3]};
}

Vector3d gravity_W_mps2(const sim::Scenario& scenario) {
  const double angle = scenario.surface.slope_rad, downhill = scenario.surface.downhill_rad;
  return scenario.gravity_mps2 *
         Vector3d(std::sin(angle) * std::cos(downhill), std::sin(angle) * std::sin(downhill), -std::cos(angle));
}

Whole whole(const sim::Scenario& scenario, const sim::Plant::Sample& p) {
  const Eigen::Quaterniond q = attitude(p);
  const Vector3d& w = p.angular_velocity_B_radps;
  struct Point {
    double mass;
    Vector3d at, velocity;
  };
  std::vector<Point> points;
  const auto add = [&](double mass, const Vector3d& at_B, const Vector3d& rate_B) {
    points.push_back({mass, p.position_W_m + q * at_B, p.velocity_W_mps + q * (w.cross(at_B) + rate_B)});
  };
  add(scenario.ball.mass_kg, scenario.ball.center_of_mass_B_m, Vector3d::Zero());
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const auto rail = firmware::evaluate(scenario.masses[i].rail, p.mass_position[i]);
    add(scenario.masses[i].mass_kg, rail.position, p.mass_velocity[i] * rail.d1);
  }
  const Vector3d spin_B = scenario.ball.inertia_kgm2.cwiseProduct(w);
  Whole out;
  out.energy_j = w.dot(spin_B) / 2 - scenario.external_force_W_n.dot(p.position_W_m);
  for (const Point& point : points) {
    out.mass_kg += point.mass;
    out.center_W_m += point.mass * point.at;
    out.velocity_W_mps += point.mass * point.velocity;
    out.energy_j += point.mass * (point.velocity.squaredNorm() / 2 - gravity_W_mps2(scenario).dot(point.at));
  }
  out.center_W_m /= out.mass_kg;
  out.velocity_W_mps /= out.mass_kg;
  out.angular_momentum_W = q * spin_B;
  for (const Point& point : points) {
    out.angular_momentum_W += point.mass * (point.at - out.center_W_m).cross(point.velocity - out.velocity_W_mps);
  }
  return out;
}

double rotor_energy_j(const sim::Scenario& scenario, const sim::Plant::Sample& p) {
  double energy = 0;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Motor& motor = scenario.masses[i].motor;
    const double rate = motor.shaft_ratio * p.mass_velocity[i];
    energy += motor.rotor_inertia_kgm2 * rate * rate / 2;
  }
  return energy;
}

Fields balanced_fields(const sim::Scenario& scenario, const sim::Plant::Sample& p) {
  Fields field{};
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Motor& motor = scenario.masses[i].motor;
    const double teeth = motor.steps_per_revolution / 4.0;
    field[i] =
        motor.shaft_ratio * p.mass_position[i] + std::asin(p.motor_torque_nm[i] / motor.holding_torque_nm) / teeth;
  }
  return field;
}

double magnetic_energy_j(const sim::Scenario& scenario, const sim::Plant::Sample& p, const Fields& field_rad) {
  double energy = 0;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Motor& motor = scenario.masses[i].motor;
    const double teeth = motor.steps_per_revolution / 4.0;
    energy -=
        motor.holding_torque_nm * std::cos(teeth * (field_rad[i] - motor.shaft_ratio * p.mass_position[i])) / teeth;
  }
  return energy;
}

Vector3d contact_velocity_W_mps(const sim::Scenario& scenario, const sim::Plant::Sample& p) {
  return p.velocity_W_mps - (attitude(p) * p.angular_velocity_B_radps).cross(Vector3d(0, 0, scenario.ball.radius_m));
}

}  // namespace ballast::test
