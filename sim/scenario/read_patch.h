// The tables [[surface.patch]] of a scenario.
#pragma once

#include "sim/plant/world.h"
#include "sim/scenario/reader.h"

namespace ballast::sim {

inline constexpr std::size_t kMaxPatches = 64;
inline constexpr std::size_t kMaxCorners = 64;  // of one polygon

// Adds the patches of [surface] to `floor`. Keys that a patch leaves out are the floor's.
void read_patches(TableReader& surface, Surface& floor);

}  // namespace ballast::sim
