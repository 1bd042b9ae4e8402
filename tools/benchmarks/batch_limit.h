// The yardstick of prescribed sweeps: eight of the paper's balls in the lanes of vector registers, RK4 with fixed
// steps, and nothing else. Written by hand for three masses on circles about the geometric centre, whose places are in
// a table, with fused multiply-add. It has no contact force, no extrema, and no check. Only the benchmarks use it.
//
// Equations: physics.md section 1. On such a circle chi . chi' = 0, which spares a part of the sums.
#pragma once

#include <array>

#include "tools/sweep/rolling_batch.h"

namespace ballast::benchmarks {

// Whether this processor has the instructions that the yardstick is compiled for.
[[nodiscard]] bool batch_limit_runs();

// Rolls the balls along the table and returns their last attitudes, w, x, y, z, lane by lane.
using BatchAttitudes = std::array<std::array<double, sweep::kLanes>, 4>;
BatchAttitudes roll_batch_limit(const sweep::MotionTable& table,
                                const std::array<sweep::BatchBall, sweep::kLanes>& balls);

}  // namespace ballast::benchmarks
