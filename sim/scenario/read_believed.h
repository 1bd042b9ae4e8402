// The table [believed] of a scenario: what controller, monitor and planner take for true.
#pragma once

#include "sim/scenario/read_mass.h"
#include "sim/scenario/scenario.h"

namespace ballast::sim {

// Sets scenario.believed from the table, which exists. Keys that are not written keep the truth. The scenario has been
// read without an error.
void read_believed(const Node& root, const MassSurroundings& around, ReadContext& context, Scenario& scenario);

}  // namespace ballast::sim
