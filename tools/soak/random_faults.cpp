#include "tools/soak/random_faults.h"

namespace ballast::soak {

std::string random_faults(const sim::Scenario&, Random&) { return ""; }

}  // namespace ballast::soak
