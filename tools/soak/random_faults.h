// The faults of a random scenario: none to three, mild or severe, of all kinds of sim/scenario/fault.h that apply.
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

// Faults that bring about what chance hardly does: steps lost by a mass whose rail has ends, so that it is driven into
// one, and a floor that becomes slippery, so that a ball slips within its envelope.
std::vector<RandomFault> aimed_faults(const sim::Scenario& scenario, Random& random);

// A fault of this kind, early enough to have an effect. The kind has to apply to the scenario.
RandomFault random_fault(const sim::Scenario& scenario, sim::FaultKind kind, int severity, Random& random);

// The meaning of a severity for a kind. A kind with one severity has the same text for both.
const char* severity_text(sim::FaultKind kind, int severity);

}  // namespace ballast::soak
