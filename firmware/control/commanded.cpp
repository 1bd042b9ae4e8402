#include "firmware/control/parts.h"

namespace ballast::firmware {

Wide profile_time(const ControllerParams& params, const ControllerState& state, std::int64_t tick) {
  return static_cast<Wide>(minus(tick, state.start_tick)) * params.control_period_s;
}

ProfilePoint commanded(const ControllerParams& params, const ControllerState& state, std::int64_t tick, int i) {
  if (!state.moving) return {state.hold_position[at(i)], 0, 0};
  return state.active[at(i)].at(profile_time(params, state, tick));
}

bool at_rest_from(const ControllerParams& params, const ControllerState& state, std::int64_t tick) {
  if (!state.moving) return true;
  if (state.tracking.follows) return false;  // what comes after the next tick is not known
  for (int i = 0; i < params.ball.mass_count; ++i) {
    if (!state.active[at(i)].at_rest_from(profile_time(params, state, tick))) return false;
  }
  return true;
}

namespace {

// The masses no longer follow a motion that is commanded tick by tick.
void leave_motion(ControllerState& state) {
  state.tracking.follows = false;
  state.governing.governs = false;
  state.course.in_force = -1;
  state.course.number_in_force = state.course.tick_in_force = 0;
}

}  // namespace

void hold(const ControllerParams& params, ControllerState& state, std::int64_t tick) {
  for (int i = 0; i < params.ball.mass_count; ++i) {
    state.hold_position[at(i)] = commanded(params, state, tick, i).position;
  }
  state.moving = false;
  state.braking = false;
  leave_motion(state);
}

void begin(ControllerState& state, std::int64_t next) {
  state.start_tick = next;
  state.started = true;
  state.moving = true;
  state.braking = false;
  leave_motion(state);
}

}  // namespace ballast::firmware
