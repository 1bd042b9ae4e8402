// Whether the floor and the envelope allow a scenario's motion.
#pragma once

#include <string>
#include <vector>

#include "sim/scenario/scenario.h"

namespace ballast {

// Rolls the ball with its masses moved exactly as `motion` says, on a floor that never lets it slip, and compares the
// forces with the scenario's floor and envelope. A warning for each limit that is passed; none for a ball that does not
// roll from the start.
[[nodiscard]] std::vector<std::string> check_floor(const sim::Scenario& scenario);

}  // namespace ballast
