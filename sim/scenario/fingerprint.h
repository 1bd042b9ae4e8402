// The fingerprint by which processes check that they run the same scenario.
#pragma once

#include "sim/scenario/scenario.h"

namespace ballast::sim {

// FNV-1a, 64 bits (Fowler, Noll, Vo; offset 14695981039346656037, prime 1099511628211), of a text that names every
// field of the checked scenario but `id`, numbers exactly. Never 0.
std::int64_t fingerprint(const Scenario& scenario);

}  // namespace ballast::sim
