// Everything the plant is built from: the world, how its masses are moved, and what is injected into it.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "sim/plant/world.h"

namespace ballast::sim {

// How the masses are moved: as the scenario's `motion` says; by steppers that a controller commands; or exactly as a
// controller commands.
enum class Actuation { kPrescribed, kStepper, kIdeal };
[[nodiscard]] constexpr bool has_controller(Actuation actuation) { return actuation != Actuation::kPrescribed; }
[[nodiscard]] constexpr const char* to_string(Actuation actuation) {
  return actuation == Actuation::kPrescribed ? "prescribed" : actuation == Actuation::kStepper ? "stepper" : "ideal";
}
// The word before "masses" in a sentence.
[[nodiscard]] constexpr const char* masses_word(Actuation actuation) {
  return actuation == Actuation::kStepper ? "stepper-driven" : to_string(actuation);
}
enum class OnViolation { kStop, kContinue };  // what happens where rolling ends

enum class PlantFaultKind {
  kMotorStall,      // the motor has no current
  kWeakCoil,        // one coil has the part `value` of its current
  kLostSteps,       // the driver misses `value` pulses
  kReversedWiring,  // the motor turns the other way
  kBlockedRail,     // the mass is held where it is
  kFrictionFalls,   // the floor's static friction falls to `value`, the kinetic in proportion
  kPush,            // a force of `value` N on the geometric centre, along direction_W
};

// A fault of motors, rails, floor or ball.
struct PlantFault {
  PlantFaultKind kind{};
  double time_s = 0;
  double end_s = std::numeric_limits<double>::infinity();  // time_s: it happens at an instant
  double value = 0;
  std::size_t mass = 0;  // faults of a motor or rail
  Eigen::Vector3d direction_W = Eigen::Vector3d::UnitX();
};

struct PlantModel : World {
  Actuation actuation = Actuation::kStepper;
  OnViolation on_violation = OnViolation::kStop;
  double duration_s = 0;            // rolling with prescribed masses is integrated ahead up to here
  double control_period_s = 0.001;  // the first trial step
  double tolerance = 1e-10;         // of a step: its error relative to 1 + |state|; a rate's to a driven mass's swing
  std::uint64_t seed = 0;           // of the motors' full-step errors
  std::vector<PlantFault> faults;   // in order of time
  bool begins_held = false;         // ideal masses do not accelerate until they are placed for the first time

  // Bound of the external force, without drag and with all pushes at once.
  [[nodiscard]] double greatest_force_n() const {
    double greatest = external_force_W_n.norm();
    for (const Eigen::Vector3d& force : force_table.forces_W_n) greatest = std::max(greatest, force.norm());
    for (const PlantFault& fault : faults) greatest += fault.kind == PlantFaultKind::kPush ? fault.value : 0;
    return greatest;
  }
};

}  // namespace ballast::sim
