// Checks that a profile keeps its motor's limits. The finished cubics are judged, independently of their planning.
#pragma once

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

// The extremes of the cubics are exact. Values up to 1e-9 of a limit above it pass, which is far more than rounding.
// The jerk is that inside the pieces; jumps of the acceleration where pieces meet, or at the start, are not judged.
[[nodiscard]] LimitBreach check_limits(const Profile& profile, const MotionLimits& limits);

// Returns the greatest number of reversals in one control tick, for ticks that begin at profile time 0.
// `added_velocity` is added to the velocity everywhere, as a start with another velocity does.
[[nodiscard]] int most_reversals(const Profile& profile, Wide control_period_s, Wide added_velocity);

}  // namespace ballast::firmware
