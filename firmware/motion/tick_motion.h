// Motion of a mass that is commanded anew in every control tick: one cubic per tick, its acceleration linear from that
// at the end of the tick before to a wanted one, as near to it as the motor's limits and the rail's ends allow.
#pragma once

#include "firmware/motion/profile.h"

namespace ballast::firmware {

// Returns the acceleration at the end of the tick that begins in `from`, the nearest to `wanted` with
//   - a change of at most max_jerk period_s (this comes first: the acceleration never jumps),
//   - at most max_acceleration,
//   - a speed that stays within max_velocity if the acceleration goes to 0 at max_jerk from then on,
//   - a speed that slows down before the ends [lowest, highest] and comes to rest there. Infinite: no end.
// Where `from` keeps the speed, so does the tick. The ends are approached with half the greatest acceleration; a mass
// that comes towards one faster than that allows, or is beyond it already, is stopped as soon as the limits above
// allow. NaN counts as 0.
[[nodiscard]] Wide reachable_acceleration(const ProfilePoint& from, Wide wanted, const MotionLimits& limits,
                                          Wide lowest, Wide highest, Wide period_s);

// Sets the profile of the tick that begins at profile time 0: linear from from.acceleration to `acceleration` within
// period_s, then constant for as long again, for what looks a little beyond the tick. False, and `profile` unchanged,
// if a number is not finite.
[[nodiscard]] bool set_tick_motion(const ProfilePoint& from, Wide acceleration, Wide period_s, Profile& profile);

}  // namespace ballast::firmware
