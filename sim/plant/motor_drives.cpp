#include "sim/plant/motor_drives.h"

#include <cmath>
#include <utility>

namespace ballast::sim {

namespace {

// Stiff enough that motor and weight together move a blocked mass by a hundredth of a tooth, or of the rail's radius.
constexpr double kBlockStiffness = 100;

// A speed or squared voltage that no motor has, and whose quotient with itself is 1.
constexpr double kNoLimit = 1e300;

}  // namespace

MotorDrives::MotorDrives(const PlantModel& model) : may_block_(!model.faults.empty()) {
  lanes_.corner_radps.fill(kNoLimit);
  lanes_.supply_v2.fill(kNoLimit);
  for (std::size_t i = 0; i < model.masses.size(); ++i) {
    const Mass& mass = model.masses[i];
    // The pattern of tooth errors differs from motor to motor of one seed.
    steppers_.emplace_back(mass.motor, mass.motor.shaft_ratio * mass.initial_position, (model.seed << 3) + i);
    if (model.actuation != Actuation::kStepper) continue;
    const Motor& motor = mass.motor;
    lanes_.present[i] = ~std::uint64_t{0};
    lanes_.shaft_ratio[i] = motor.shaft_ratio;
    lanes_.teeth[i] = motor.rotor_teeth();
    lanes_.viscous_damping[i] = motor.viscous_damping_nms;
    lanes_.torque_nm[i] = motor.holding_torque_nm;
    if (motor.has_winding()) {
      const PhaseCurrent& phases = steppers_[i].phases();
      lanes_.resistance_v[i] = phases.resistance_v();
      lanes_.amplitude_a[i] = phases.amplitude_a();
      lanes_.back_emf_vs[i] = phases.back_emf_vs();
      lanes_.supply_v2[i] = phases.supply_v() * phases.supply_v();
    } else {
      lanes_.corner_radps[i] = motor.corner_speed_radps;
    }
    end_stops_[i] = EndStops(mass.rail, mass.moving_inertia(), mass.end_stops);
    if (end_stops_[i].present()) with_stops_.push_back(i);
    const bool circle = mass.rail.shape == firmware::RailShape::kCircle;
    const double weight = mass.mass_kg * model.gravity_mps2 * (circle ? mass.rail.radius_m : 1 / model.ball.radius_m);
    const double stiffness = kBlockStiffness * (mass.motor.rail_stiffness() + weight);
    blocks_[i] = {false, 0, stiffness, 2 * std::sqrt(stiffness * mass.moving_inertia())};
  }
}

PerMass MotorDrives::forces(const double* position, const double* velocity) const {
  PerMass force{};
  for (std::size_t i = 0; i < steppers_.size(); ++i) {
    const double shaft = steppers_[i].motor().shaft_ratio;
    force[i] = shaft * steppers_[i].torque_nm(shaft * position[i], shaft * velocity[i]);
  }
  add_holding_forces(position, velocity, force.data());
  return force;
}

void MotorDrives::add_holding_forces(const double* position, const double* velocity, double* force) const {
  if (!may_block_) {
    for (const std::size_t i : with_stops_) force[i] += stop_force_n(i, position[i], velocity[i]);
    return;
  }
  for (std::size_t i = 0; i < size(); ++i) force[i] += holding_force(i, position[i], velocity[i]);
}

const LaneMotors* MotorDrives::lanes() const {
  if (const std::uint32_t old = std::exchange(old_lanes_, 0); old != 0) {
    for (std::size_t i = 0; i < size(); ++i) {
      if ((old >> i & 1) == 0) continue;
      const Stepper& stepper = steppers_[i];
      unsound_lanes_ &= ~(std::uint32_t{1} << i);
      if (!stepper.sound()) unsound_lanes_ |= std::uint32_t{1} << i;
      lanes_.field_rad[i] = stepper.field_rad();
      lanes_.reactance_v[i] = stepper.phases().reactance_v(stepper.field_radps());
      const auto detent = firmware::sin_cos(4 * lanes_.teeth[i] * stepper.field_rad());
      lanes_.detent_sin_nm[i] = stepper.motor().detent_torque_nm * detent.sin;
      lanes_.detent_cos_nm[i] = stepper.motor().detent_torque_nm * detent.cos;
    }
  }
  return unsound_lanes_ == 0 ? &lanes_ : nullptr;
}

bool MotorDrives::update_stop(std::size_t i, double position, double velocity) {
  const int before = stop_side_[i];
  stop_side_[i] = end_stops_[i].touched(position, velocity);
  return stop_side_[i] != before && stop_side_[i] != 0;
}

void MotorDrives::block(std::size_t i, double position) {
  if (blocks_[i].on) return;
  blocks_[i].on = true;
  blocks_[i].position = position;
}

}  // namespace ballast::sim
