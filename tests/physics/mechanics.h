// Energy and momentum of the whole, body by body from what the plant shows of its state: what the conservation laws are
// about. Space frame.
#pragma once

#include <array>

#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"

namespace ballast::test {

struct Whole {
  double mass_kg = 0;
  Eigen::Vector3d center_W_m = Eigen::Vector3d::Zero();  // centre of mass
  Eigen::Vector3d velocity_W_mps = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_momentum_W = Eigen::Vector3d::Zero();  // about the centre of mass, kg m^2/s
  double energy_j = 0;  // kinetic, of weight above the GC's start, and the potential -F_e . z of the external force
};

// Gravity in the frame of the floor, which may slope.
Eigen::Vector3d gravity_W_mps2(const sim::Scenario& scenario);

// Shell and masses, without the motors' rotors.
Whole whole(const sim::Scenario& scenario, const sim::Plant::Sample& sample);

// Energy of the rotors' turning against the ball; the model does not couple their spin to the ball's.
double rotor_energy_j(const sim::Scenario& scenario, const sim::Plant::Sample& sample);

using Fields = std::array<double, sim::kMaxMasses>;  // shaft angles at which the fields of the steppers stand

// As the plant has balanced them at t = 0: motors without detent, step error and (unless at rest) damping.
Fields balanced_fields(const sim::Scenario& scenario, const sim::Plant::Sample& at_start);

// Energy of fields that stay there, -tau_hold cos(N_r lag) / N_r each, below the corner speed.
double magnetic_energy_j(const sim::Scenario& scenario, const sim::Plant::Sample& sample, const Fields& field_rad);

// Velocity of the ball's lowest point: 0 in rolling, the slip in sliding.
Eigen::Vector3d contact_velocity_W_mps(const sim::Scenario& scenario, const sim::Plant::Sample& sample);

Eigen::Quaterniond attitude(const sim::Plant::Sample& sample);

}  // namespace ballast::test
