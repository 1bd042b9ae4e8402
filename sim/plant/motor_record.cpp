#include "sim/plant/motor_record.h"

#include <algorithm>
#include <cmath>

namespace ballast::sim {

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

void MotorRecord::record_energy(const Dynamics& dynamics, double h, const Point& middle, const Point& end) {
  const std::array<const Point*, 3> points{&dynamics.now, &middle, &end};
  constexpr std::array<double, 3> kWeight{1. / 6, 4. / 6, 1. / 6};
  const MotorDrives& motors = dynamics.equations.motors;
  const std::size_t n = motors.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Stepper& stepper = motors.stepper(i);
    const Motor& motor = stepper.motor();
    MotorEnergy& energy = energy_[i];
    for (std::size_t k = 0; k < 3; ++k) {
      const State& y = points[k]->y;
      const double rate = y[kTheta + n + i], speed = motor.shaft_ratio * rate, part_s = kWeight[k] * h;
      const double held = motors.holding_force(i, y[kTheta + i], rate);
      energy.work_j += part_s * (points[k]->motion.generalised_force[i] - held) * rate;
      energy.friction_j += part_s * motor.viscous_damping_nms * speed * speed;
      if (!motor.has_winding()) continue;
      const auto current = stepper.current(motor.shaft_ratio * y[kTheta + i], speed);
      energy.copper_j += part_s * stepper.phases().copper_loss_w(current);
      energy.electrical_j += part_s * stepper.terminal_power_w(current, speed);
    }
  }
}

MotorRecord::StoredEnergy MotorRecord::stored_energy(const Stepper& stepper, double position, double velocity) {
  const double shaft = stepper.motor().shaft_ratio, angle = shaft * position;
  return {stepper.phases().field_energy_j(stepper.current(angle, shaft * velocity)), stepper.detent_energy_j(angle)};
}

MotorEnergy MotorRecord::energy(std::size_t i, const Dynamics& dynamics) const {
  MotorEnergy energy = energy_[i];
  if (!dynamics.equations.driven()) return energy;
  const MassPoint masses = dynamics.masses();
  const StoredEnergy now = stored_energy(dynamics.equations.motors.stepper(i), masses.position[i], masses.velocity[i]);
  const double field_j = now.winding_j - stored_at_start_[i].winding_j;
  energy.electrical_j += field_j;
  energy.stored_j = field_j + now.detent_j - stored_at_start_[i].detent_j;
  return energy;
}

}  // namespace ballast::sim
