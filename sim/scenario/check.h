// Checks a scenario's tree and makes the Scenario.
#pragma once

#include "sim/scenario/reader.h"

namespace ballast::sim {

// Adds every fault to the context's errors; the result is meaningful only if there is none. Its id is not set.
Scenario check_scenario(const Node& root, ReadContext& context);

}  // namespace ballast::sim
