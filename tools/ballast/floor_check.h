// Whether the floor and the envelope allow a scenario's motion.
#pragma once

#include <string>
#include <vector>

#include "sim/scenario/scenario.h"

namespace ballast {

struct FloorFindings {
  std::vector<std::string> warnings;  // a limit that is passed, a ball that lifts off, an end for want of a solution
  std::vector<std::string> notes;     // a long run that is not checked to its end
};

// Rolls the ball with its masses moved exactly as `motion` says, on a floor that never lets it slip, and compares the
// forces with the scenario's floor and envelope. Nothing is found for a ball that does not roll from the start.
[[nodiscard]] FloorFindings check_floor(const sim::Scenario& scenario);

}  // namespace ballast
