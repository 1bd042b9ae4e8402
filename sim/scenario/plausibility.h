// Values that can be computed with and that no robot has: wrong units, degrees for radians, a body heavier at its rim
// than anywhere. They are warnings; the scenario still runs.
#pragma once

#include "sim/scenario/reader.h"

namespace ballast::sim {

// Adds a warning for each implausible value of an accepted scenario, with the likely meaning. `root` is the tree it was
// read from, `source_name` its file. Assumes SI units in what it suggests.
void warn_of_implausible_values(const Node& root, const std::string& source_name, const Scenario& scenario,
                                std::vector<ScenarioError>& warnings);

// The least distance between two rails, in m, over the parts on which a mass may stand; sampled, then refined to about
// 1e-6 of their size.
double rail_distance_m(const firmware::Rail& a, const firmware::Rail& b);

}  // namespace ballast::sim
