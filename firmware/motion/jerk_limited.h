// Jerk-limited motions of one coordinate: a stop from any state, and a move from rest to rest.
//
// Source: our derivation. The problem and its division into a shortest motion per coordinate and a stretching to the
// slowest are those of Berscheid and Kroeger, "Jerk-limited real-time trajectory generation with arbitrary target
// states" (Ruckig); less is asked here: stops may begin in any state, moves only at rest, so that both are closed
// forms.
#pragma once

#include <array>

#include "firmware/motion/limits.h"
#include "firmware/motion/profile.h"

namespace ballast::firmware {

// Pieces of a motion, acceleration continuous where they meet. Without pieces: nothing has to be done.
struct PlannedPieces {
  int count = 0;
  std::array<ProfilePiece, kMaxPlannedPieces> piece{};
  [[nodiscard]] Wide duration_s() const;
};

// To velocity 0 and acceleration 0 from `velocity` and `acceleration`, at most 3 pieces: the acceleration goes at
// max_jerk to a peak against the velocity that would be left if it went to 0 at once, stays there, and goes to 0 at
// max_jerk. An acceleration beyond max_acceleration comes inside it at max_jerk first. The velocity changes sign only
// where the initial acceleration makes it inevitable. max_velocity is not read: a stop may have to pass it.
// With duration_s = 0, or less than the shortest: the shortest. Else the peak is lowered so that it takes duration_s; a
// stop that is nothing but the acceleration's way to 0 cannot be stretched and ends before.
// False (and `out` unchanged) if a number is not finite or out of range.
[[nodiscard]] bool plan_stop(Wide velocity, Wide acceleration, const MotionLimits& limits, Wide duration_s,
                             PlannedPieces& out);

// From rest to rest, `distance` away, at most 7 pieces. With duration_s = 0, or less than the shortest: the shortest.
// Else the shortest motion slowed down by k = shortest / duration_s: velocities times k, accelerations k^2, jerks k^3.
// False (and `out` unchanged) if a number is not finite or out of range.
[[nodiscard]] bool plan_move(Wide distance, const MotionLimits& limits, Wide duration_s, PlannedPieces& out);

}  // namespace ballast::firmware
