#include "sim/plant/motor_drives.h"

#include <cmath>

namespace ballast::sim {

namespace {

// Stiff enough that motor and weight together move a blocked mass by a hundredth of a tooth, or of the rail's radius.
constexpr double kBlockStiffness = 100;

}  // namespace

MotorDrives::MotorDrives(const PlantModel& model) : may_block_(!model.faults.empty()) {
  for (std::size_t i = 0; i < model.masses.size(); ++i) {
    const Mass& mass = model.masses[i];
    // The pattern of tooth errors differs from motor to motor of one seed.
    steppers_.emplace_back(mass.motor, mass.motor.shaft_ratio * mass.initial_position, (model.seed << 3) + i);
    if (model.actuation != Actuation::kStepper) continue;
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
  if (!may_block_) {
    for (const std::size_t i : with_stops_) force[i] += stop_force_n(i, position[i], velocity[i]);
    return force;
  }
  for (std::size_t i = 0; i < size(); ++i) force[i] += holding_force(i, position[i], velocity[i]);
  return force;
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
