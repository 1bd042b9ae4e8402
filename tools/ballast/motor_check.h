// The load on a scenario's motors along its motion: whether they have the torque, and which resonances
// their full steps pass through.
#pragma once

#include <string>
#include <vector>

#include "sim/scenario/scenario.h"

namespace ballast {

struct MotorFindings {
  std::vector<std::string> warnings;  // a motor that lacks torque
  std::vector<std::string> notes;     // resonances
};

// Rolls the ball with its masses moved exactly as `motion` says, up to where the motion has ended, the run ends or
// rolling is lost, and compares what each mass needs with what its motor has at that speed.
MotorFindings check_motors(const sim::Scenario& scenario);

// The frequency at which rotor and mass swing about the field of a motor at rest.
[[nodiscard]] double swing_hz(const sim::Mass& mass);

}  // namespace ballast
