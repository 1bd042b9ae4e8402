// What goes wrong in a random scenario: none to three faults of the kinds that sim/fault.h knows and that apply to it.
#pragma once

#include <string>

#include "sim/scenario.h"
#include "tools/soak/random.h"

namespace ballast::soak {

// As the [[fault]] tables of its scenario file.
std::string random_faults(const sim::Scenario& scenario, Random& random);

}  // namespace ballast::soak
