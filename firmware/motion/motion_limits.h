// Whether a profile keeps its motor's limits: judged from the finished cubics, not from how they were made.
#pragma once

#include "firmware/motion/limits.h"
#include "firmware/motion/profile.h"

namespace ballast::firmware {

enum class Limited : std::uint8_t { kNothing, kVelocity, kAcceleration, kJerk };

// The first piece that breaks a limit, and how far it goes.
struct LimitBreach {
  Limited what = Limited::kNothing;
  int piece = -1;  // counted from 0; piece_count(): the constant velocity after the last
  Wide value = 0;  // largest |.| in that piece
  [[nodiscard]] bool ok() const { return what == Limited::kNothing; }
};

// Extremes are those of the cubics, exact. A part in 1e9 above a limit passes: rounding, with room to spare. The jerk
// is the one inside the pieces; jumps of the acceleration where pieces meet, or at the start, are not looked at.
[[nodiscard]] LimitBreach check_limits(const Profile& profile, const MotionLimits& limits);

// Most reversals of the profile in one control tick, if its ticks begin at profile time 0. `added_velocity` is added to
// the velocity everywhere: the same pieces from another start.
[[nodiscard]] int most_reversals(const Profile& profile, Wide control_period_s, Wide added_velocity);

}  // namespace ballast::firmware
