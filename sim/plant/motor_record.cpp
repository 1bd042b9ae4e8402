#include "sim/plant/motor_record.h"

#include <algorithm>
#include <cmath>

namespace ballast::sim {

namespace {

struct MassMotion {
  double position, rate, acceleration;
};

// The inner point of Lobatto's rule that is nearer to `near`, on the polynomial of degree 5 through both ends. `h` is
// the time from `near` to `far`. `acceleration` stays 0.
MassMotion inside(const MassMotion& near, const MassMotion& far, double h) {
  constexpr double kRoot5 = 2.23606797749978969;
  const double travel = far.position - near.position;
  const double bend = (0.01 + kRoot5 / 500) * near.acceleration + (0.01 - kRoot5 / 500) * far.acceleration;
  const double slope = (4 * kRoot5 / 125 + 0.12) * near.rate + (4 * kRoot5 / 125 - 0.12) * far.rate;
  const double position = near.position + (0.5 - 41 * kRoot5 / 250) * travel + h * (slope + h * bend);
  const double rate = 1.2 * travel / h + (7 * kRoot5 / 50 - 0.1) * near.rate - (7 * kRoot5 / 50 + 0.1) * far.rate +
                      kRoot5 / 50 * h * (near.acceleration + far.acceleration);
  return {position, rate, 0};
}

// Adds `part_s` of the powers at an instant.
void add_energy(double part_s, const Stepper& stepper, double torque_nm, double shaft_rad, double shaft_radps,
                MotorEnergy& to) {
  to.work_j += part_s * torque_nm * shaft_radps;
  to.friction_j += part_s * stepper.motor().viscous_damping_nms * shaft_radps * shaft_radps;
  if (!stepper.motor().has_winding()) return;
  const auto current = stepper.current(shaft_rad, shaft_radps);
  to.copper_j += part_s * stepper.phases().copper_loss_w(current);
  to.electrical_j += part_s * stepper.terminal_power_w(current, shaft_radps);
}

}  // namespace

void MotorRecord::start(const Equations& equations, const MassPoint& masses) {
  for (std::size_t i = 0; i < equations.mass_count(); ++i) {
    stored_at_start_[i] = stored_energy(equations.motors.stepper(i), masses.position[i], masses.velocity[i]);
  }
}

void MotorRecord::record_touch(std::size_t i, double time_s) {
  if (end_stop_[i].touches == 0) end_stop_[i].first_s = time_s;
  ++end_stop_[i].touches;
}

void MotorRecord::record(Dynamics& dynamics) {
  const Equations& equations = dynamics.equations;
  if (equations.mass_count() == 0) return;
  const MassPoint masses = dynamics.masses();
  if (!equations.driven()) {
    torque_nm_ = equations.needed_torques(dynamics.now.y.data(), dynamics.now.motion, masses);
  }
  for (std::size_t i = 0; i < equations.mass_count(); ++i) {
    if (!equations.body.trajectory[i].empty()) continue;  // no motor
    MotorExtrema& extrema = extrema_[i];
    double margin;
    if (equations.driven()) {
      record_driven(dynamics, i, masses);
      const Stepper& stepper = equations.motors.stepper(i);
      const double shaft = stepper.motor().shaft_ratio;
      dynamics.equations.motors.count_slips(i, shaft * masses.position[i]);
      margin = stepper.torque_margin(shaft * masses.position[i], shaft * masses.velocity[i]);
    } else {
      const Stepper& stepper = equations.motors.stepper(i);
      const double speed = stepper.motor().shaft_ratio * masses.velocity[i];
      margin = 1 - std::abs(torque_nm_[i] + stepper.motor().viscous_damping_nms * speed) /
                       stepper.available_torque_nm(speed);
    }
    extrema.max_torque_nm = std::max(extrema.max_torque_nm, std::abs(torque_nm_[i]));
    extrema.torque_margin = std::min(extrema.torque_margin, margin);
  }
}

void MotorRecord::record_driven(Dynamics& dynamics, std::size_t i, const MassPoint& masses) {
  const Equations& equations = dynamics.equations;
  const MotorDrives& motors = equations.motors;
  const double position = masses.position[i], velocity = masses.velocity[i];
  const double held = motors.holding_force(i, position, velocity);
  torque_nm_[i] = (dynamics.now.motion.generalised_force[i] - held) / motors.stepper(i).motor().shaft_ratio;
  EndStopRecord& stop = end_stop_[i];
  stop.max_force_n = std::max(stop.max_force_n, std::abs(motors.stop_force_n(i, position, velocity)));
  if (motors.stop_side(i) == 0) return;
  const double outside_m = equations.body.path(i, position).position.norm() - equations.body.radius_m;
  if (outside_m > 0 && stop.outside_ball_s < 0) stop.outside_ball_s = dynamics.time_s;
  stop.outside_ball_m = std::max(stop.outside_ball_m, outside_m);
}

// Lobatto's rule of order 6: the ends of the span and two points inside, where the masses are by their positions, rates
// and accelerations at the ends.
void MotorRecord::record_energy(const Dynamics& dynamics, double h, const Point& end) {
  constexpr double kAtEnds = 1. / 12, kInside = 5. / 12;
  const MotorDrives& motors = dynamics.equations.motors;
  const std::size_t n = motors.size();
  const LaneSpan span{dynamics.now.y.data(), dynamics.now.dydt.data(), end.y.data(), end.dydt.data()};
  const LaneMotors* lanes = motors.lanes();
  if (lanes != nullptr && driven_lanes().energies(*lanes, n, h, span, lane_energies_)) return;
  for (std::size_t i = 0; i < n; ++i) {
    const Stepper& stepper = motors.stepper(i);
    const double shaft = stepper.motor().shaft_ratio;
    const auto mass_at = [&](const Point& point) {
      return MassMotion{point.y[kTheta + i], point.y[kTheta + n + i], point.dydt[kTheta + n + i]};
    };
    const auto add_end = [&](double part_s, const MassMotion& mass, const Point& point) {
      const double held = motors.holding_force(i, mass.position, mass.rate);
      const double torque_nm = (point.motion.generalised_force[i] - held) / shaft;
      add_energy(part_s, stepper, torque_nm, shaft * mass.position, shaft * mass.rate, energy_[i]);
    };
    const auto add_inside = [&](double part_s, const MassMotion& mass) {
      const double angle = shaft * mass.position, speed = shaft * mass.rate;
      add_energy(part_s, stepper, stepper.torque_nm(angle, speed), angle, speed, energy_[i]);
    };
    const MassMotion first = mass_at(dynamics.now), last = mass_at(end);
    add_end(kAtEnds * h, first, dynamics.now);
    add_inside(kInside * h, inside(first, last, h));
    add_inside(kInside * h, inside(last, first, -h));
    add_end(kAtEnds * h, last, end);
  }
}

MotorRecord::StoredEnergy MotorRecord::stored_energy(const Stepper& stepper, double position, double velocity) {
  const double shaft = stepper.motor().shaft_ratio, angle = shaft * position;
  return {stepper.phases().field_energy_j(stepper.current(angle, shaft * velocity)), stepper.detent_energy_j(angle)};
}

MotorEnergy MotorRecord::energy(std::size_t i, const Dynamics& dynamics) const {
  MotorEnergy energy = energy_[i];
  energy.electrical_j += lane_energies_.electrical_j[i];
  energy.copper_j += lane_energies_.copper_j[i];
  energy.friction_j += lane_energies_.friction_j[i];
  energy.work_j += lane_energies_.work_j[i];
  if (!dynamics.equations.driven()) return energy;
  const MassPoint masses = dynamics.masses();
  const StoredEnergy now = stored_energy(dynamics.equations.motors.stepper(i), masses.position[i], masses.velocity[i]);
  const double field_j = now.winding_j - stored_at_start_[i].winding_j;
  energy.electrical_j += field_j;
  energy.stored_j = field_j + now.detent_j - stored_at_start_[i].detent_j;
  return energy;
}

}  // namespace ballast::sim
