#include <cmath>
#include <limits>

#include "firmware/control/parts.h"
#include "firmware/motion/jerk_limited.h"
#include "firmware/motion/motion_limits.h"
#include "firmware/motion/rail_ends.h"

namespace ballast::firmware {

namespace {

// Plans a stop from this state in duration_s or, if that is less, the shortest time. False: `profile` is unchanged, or
// does not end at rest.
bool stop(Profile& profile, const ProfilePoint& from, const MotionLimits& limits, Wide duration_s) {
  PlannedPieces pieces;
  if (!plan_stop(from.velocity, from.acceleration, limits, duration_s, pieces) ||
      !profile.set(from.position, from.velocity, pieces.piece.data(), pieces.count)) {
    return false;
  }
  // Checked by code that did not plan it.
  const MotionLimits allowed{std::numeric_limits<Wide>::infinity(),
                             std::fmax(limits.max_acceleration, std::fabs(from.acceleration)), limits.max_jerk};
  return profile.at_rest_from(profile.end_s()) && check_limits(profile, allowed).ok();
}

// Rounding can leave a mass a speed, and one so small that a stop from it has no numbers. A billionth of a microstep a
// second is rest.
bool rests(const ControllerParams& params, const ProfilePoint& p, int i) {
  const Wide least = Wide(1e-9) / std::fabs(params.motor[at(i)].steps_per_unit);
  return std::fabs(p.velocity) < least && std::fabs(p.acceleration) * params.control_period_s < least;
}

// State from which mass i stops at the start of `next`. An acceleration that raises the speed takes time to fade at the
// greatest jerk, and raises it by a^2 / (2 jerk) meanwhile. Near the motor's step rate it therefore begins lower, so
// that the stop does not pass that rate.
ProfilePoint stop_start(const ControllerParams& params, const ControllerState& state, std::int64_t next, int i) {
  ProfilePoint p = commanded(params, state, next, i);
  if (rests(params, p, i)) p.velocity = p.acceleration = 0;
  const MotionLimits limits = motion_limits(params, i);
  const Wide left = std::fmax(limits.max_velocity - std::fabs(p.velocity), 0);
  const Wide most = std::sqrt(2 * limits.max_jerk * left);
  if (p.acceleration * p.velocity > 0 && std::fabs(p.acceleration) > most) {
    p.acceleration = std::copysign(most, p.velocity);
  }
  return p;
}

}  // namespace

void begin_stop(const ControllerParams& params, ControllerState& state, std::int64_t next) {
  PlannedPieces pieces;
  Wide slowest_s = 0;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    const ProfilePoint p = stop_start(params, state, next, i);
    if (plan_stop(p.velocity, p.acceleration, motion_limits(params, i), 0, pieces)) {
      slowest_s = std::fmax(slowest_s, pieces.duration_s());
    }
  }
  for (int i = 0; i < params.ball.mass_count; ++i) {
    const ProfilePoint p = stop_start(params, state, next, i);
    const MotionLimits limits = motion_limits(params, i);
    Profile& profile = state.active[at(i)];
    if (stop(profile, p, limits, slowest_s) && on_rail(params.ball, i, profile.final_position())) continue;
    if (stop(profile, p, limits, 0)) continue;
    state.faults |= bit(Fault::kInternal);
    // The motor's position after its last step. It fits any profile.
    const Wide position = params.motion[at(i)].at(0).position +
                          static_cast<Wide>(state.position_steps[at(i)]) / params.motor[at(i)].steps_per_unit;
    static_cast<void>(profile.set(position, 0, nullptr, 0));
  }
  state.start_tick = next;
  state.braking = true;
  state.tracking.follows = false;
  state.governing.governs = false;
}

}  // namespace ballast::firmware
