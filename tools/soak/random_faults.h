// What goes wrong in a random scenario: none to three faults, of all kinds of sim/scenario/fault.h that apply to it, each mild
// or severe.
#pragma once

#include <string>
#include <vector>

#include "sim/scenario/fault.h"
#include "sim/scenario/scenario.h"
#include "tools/soak/random.h"

namespace ballast::soak {

struct RandomFault {
  sim::FaultKind kind;
  int severity;      // 0 mild, 1 severe
  std::string toml;  // its [[fault]] table
};

std::vector<RandomFault> random_faults(const sim::Scenario& scenario, Random& random);

// One of this kind, early enough to be seen. The kind has to apply.
RandomFault random_fault(const sim::Scenario& scenario, sim::FaultKind kind, int severity, Random& random);

// What mild and severe mean for a kind; the same words where it has only one severity.
const char* severity_text(sim::FaultKind kind, int severity);

}  // namespace ballast::soak
