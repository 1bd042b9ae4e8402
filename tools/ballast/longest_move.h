// The longest move that is made without --force.
#pragma once

#include <algorithm>

namespace ballast {

// A run without --lcm records 2.4 MB a second at 1 kHz, so a longer move is probably a mistake, unless the scenario
// itself is as long. `scenario_s`: its duration; 0: it is not known.
inline double longest_move_s(double scenario_s) {
  constexpr double kLongest_s = 600;
  return std::max(kLongest_s, scenario_s);
}

}  // namespace ballast
