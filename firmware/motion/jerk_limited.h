// Jerk-limited motions of one coordinate: a stop from any state, and a move from rest to rest.
//
// Source: our derivation. The problem, and its division into a shortest motion per coordinate and stretching to the
// slowest, follow Berscheid and Kroeger, "Jerk-limited real-time trajectory generation with arbitrary target states"
// (Ruckig). Here stops may begin in any state and moves only at rest, so both have closed forms.
#pragma once

#include <array>

#include "firmware/motion/profile.h"

namespace ballast::firmware {

// Pieces of a motion, with continuous acceleration where they meet. No pieces: the motion is complete already.
struct PlannedPieces {
  int count = 0;
  std::array<ProfilePiece, kMaxPlannedPieces> piece{};
  [[nodiscard]] Wide duration_s() const;
};

// Plans a stop, to velocity 0 and acceleration 0 from `velocity` and `acceleration`, in at most 3 pieces. The
// acceleration goes at max_jerk to a peak against the velocity that would be left if it went to 0 at once, stays there,
// and goes to 0 at max_jerk. An acceleration beyond max_acceleration first returns to it at max_jerk. The velocity
// changes sign only where the initial acceleration makes it inevitable. max_velocity is not read, because a stop may
// have to pass it. duration_s below the shortest time, such as 0, gives the shortest stop. Otherwise the peak is
// lowered so that the stop takes duration_s. A stop that only brings the acceleration to 0 cannot be stretched and ends
// earlier. False, and `out` unchanged, if a number is not finite or out of range.
[[nodiscard]] bool plan_stop(Wide velocity, Wide acceleration, const MotionLimits& limits, Wide duration_s,
                             PlannedPieces& out);

// Plans a move from rest to rest over `distance`, in at most 7 pieces. duration_s below the shortest time, such as 0,
// gives the shortest move. Otherwise that is slowed down by k = shortest / duration_s: velocities times k,
// accelerations k^2, jerks k^3. False, and `out` unchanged, if a number is not finite or out of range.
[[nodiscard]] bool plan_move(Wide distance, const MotionLimits& limits, Wide duration_s, PlannedPieces& out);

}  // namespace ballast::firmware
