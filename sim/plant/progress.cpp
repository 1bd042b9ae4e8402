#include "sim/plant/progress.h"

#include <algorithm>

namespace ballast::sim {

Progress::Progress(const PlantModel& model)
    : dynamics(model),
      contact(std::max(dynamics.equations.body.total_mass_kg * model.gravity_mps2, model.greatest_force_n())) {
  update_stops();
}

void Progress::record() {
  contact.record(dynamics.equations, dynamics.time_s, dynamics.now.y, dynamics.now.motion);
  motors.record(dynamics);
}

void Progress::update_stops() {
  MotorDrives& drives = dynamics.equations.motors;
  const State& y = dynamics.now.y;
  for (const std::size_t i : drives.with_stops()) {
    if (drives.update_stop(i, y[kTheta + i], y[kTheta + drives.size() + i])) motors.record_touch(i, dynamics.time_s);
  }
}

Sample Progress::sample() const {
  const Equations& equations = dynamics.equations;
  const Body& body = equations.body;
  const State& y = dynamics.now.y;
  const Instant& motion = dynamics.now.motion;
  const ContactRegime& floor = equations.contact;
  const MassPoint masses = dynamics.masses();
  Sample s{};
  s.time_s = dynamics.time_s;
  s.orientation = {y[0], y[1], y[2], y[3]};
  s.angular_velocity_B_radps = {y[kOmega], y[kOmega + 1], y[kOmega + 2]};
  const State& rates = dynamics.now.dydt;
  s.angular_acceleration_B_radps2 = {rates[kOmega], rates[kOmega + 1], rates[kOmega + 2]};
  s.position_W_m = {y[kZ], y[kZ + 1], 0};
  s.velocity_W_mps = {dynamics.now.dydt[kZ], dynamics.now.dydt[kZ + 1], 0};
  s.regime = floor.regime;
  s.floor_static_friction = floor.static_friction;
  if (floor.regime != Regime::kRolling) {
    s.position_W_m[2] = y[equations.contact_start()];
    s.velocity_W_mps[2] = y[equations.contact_start() + 3];
  }
  s.acceleration_B_mps2 = motion.acceleration_B_mps2;
  s.up_B = motion.up_B;
  s.normal_force_n = reported_normal_n(motion.normal_force_n);
  s.static_friction_n = motion.static_friction_n;
  s.normal_force_min_n = contact.tick_normal_force_min_n();
  s.mu_required_max = contact.tick_mu_required_max();
  s.friction_force_W_n = (motion.rotation_B_to_W * motion.contact_force_B_n).head<2>();
  s.center_of_mass_B_m = body.shell_mass_kg * body.center_of_mass_B_m;
  for (std::size_t i = 0; i < equations.mass_count(); ++i) {
    s.mass_position[i] = masses.position[i];
    s.mass_velocity[i] = masses.velocity[i];
    s.mass_position_B_m[i] = body.path(i, masses.position[i]).position;
    s.center_of_mass_B_m += body.mass_kg[i] * s.mass_position_B_m[i];
    s.motor_torque_nm[i] = motors.torque_nm(i);
    s.lost_steps[i] = equations.motors.stepper(i).lost_steps();
    s.end_switches[i] = body.rail[i].lower_end >= masses.position[i] ? 1 : 0;
    if (body.rail[i].upper_end <= masses.position[i]) s.end_switches[i] |= 2;
  }
  s.center_of_mass_B_m /= body.total_mass_kg;
  return s;
}

}  // namespace ballast::sim
