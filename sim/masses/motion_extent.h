// The extremes of a prescribed motion. They are exact, because a cubic's lie at the roots of its derivative.
#pragma once

#include <cstddef>

#include "sim/masses/mass.h"

namespace ballast::sim {

// A coordinate at its extreme. `piece` counts from 0; the motion's size means the constant velocity that follows.
struct Extreme {
  double position = 0;
  double time_s = 0;
  std::size_t piece = 0;
};

// The least and the greatest rail coordinate on 0 <= t <= duration_s.
struct PositionExtent {
  Extreme least;
  Extreme greatest;
};
PositionExtent position_extent(const Mass& mass, double duration_s);

// The greatest |theta'|, |theta''| and |theta'''| of the whole motion, and the first piece that has each; 0 if there is
// none. |theta'''| is taken inside the pieces, not where they meet.
struct SpeedExtent {
  double greatest_speed = 0;
  std::size_t fastest_piece = 0;
  double greatest_acceleration = 0;
  std::size_t hardest_piece = 0;
  double greatest_jerk = 0;
  std::size_t jerkiest_piece = 0;
};
SpeedExtent speed_extent(const Mass& mass);

}  // namespace ballast::sim
