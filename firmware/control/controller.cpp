#include "firmware/control/controller.h"

#include "firmware/control/parts.h"
#include "firmware/safety/modes.h"

namespace ballast::firmware {

namespace {

// Takes over from the last tick. After a gap the masses hold: commands were issued for every tick up to last_tick + 1,
// whose end is the start of last_tick + 2.
Order follow_last_tick(const ControllerParams& params, ControllerState& state, std::int64_t tick) {
  const Order order = order_of(state, tick);
  if (order == Order::kBroken) {
    if (state.moving) hold(params, state, plus(state.last_tick, 2));
    // The last pulses came at an unknown time, now at the latest.
    for (LastPulse& last : state.last_pulse) last.tick = tick;
  }
  state.ticked = true;
  state.last_tick = tick;
  state.planned_motion_now = false;
  return order;
}

// Trips if a fault allows nothing else. A pending move is cancelled.
void trip(ControllerState& state, const GuardState& guards) {
  const Mode after = next_mode(state.mode, Event::kFault, guards);
  if (state.mode == Mode::kPending && after != state.mode) {
    drop_move(state);
    state.refusal = {Refusal::kCancelled, -1, -1, 0};
  }
  state.mode = after;
}

// Begins the pending move when its tick comes, or refuses it where the governor has no certificate.
void begin_move(const ControllerParams& params, ControllerState& state, const GuardState& guards, std::int64_t next) {
  const bool due = next == state.plan_tick;
  const StartStage stage = state.governing.start.stage;
  if (params.governor.on && (due || stage == StartStage::kRefused)) {
    if (const RefusalReport refusal = judge_start(params, state); refusal.reason != Refusal::kNone) {
      state.refusal = refusal;
      drop_move(state);
      state.mode = next_mode(state.mode, Event::kStop, guards);
      return;
    }
  }
  if (!due) return;
  if (!state.planned) {
    state.faults |= bit(Fault::kInternal);  // pending_ticks() would be too few
    trip(state, guards);
    return;
  }
  state.mode = next_mode(state.mode, Event::kDue, guards);
  begin(state, next);
  state.governing.start.stage = StartStage::kUsed;
}

// Makes the steps of the next tick: of the motion, a move or a stop.
void command_steps(const ControllerParams& params, const Inputs& inputs, ControllerState& state, StepCommand& steps) {
  bool stop_begins = false;
  const bool follows = state.mode == Mode::kRunning || state.mode == Mode::kMoving || state.mode == Mode::kHalting;
  if (!follows && !state.braking) {
    begin_stop(params, state, steps.tick);
    stop_begins = true;
  }
  if (state.tracking.follows) track(params, inputs, state, steps.tick);
  if (!generate_all(params, state, steps)) {
    state.faults |= bit(Fault::kStepOverload);
    stop_overloaded(params, state, steps);
    stop_begins = true;
  }
  if (stop_begins) {
    state.plan_tick = steps.tick;
    begin_prediction(params, inputs, state);
  }
  count(steps, state);
}

}  // namespace

void reset(const ControllerParams& params, ControllerState& state) {
  // Member by member: a temporary of the whole state would need 200 kB of stack. The profiles are not read before
  // `moving`, the predictor not before a plan, and a course not before its parts.
  state.mode = Mode::kDisarmed;
  state.faults = 0;
  state.ticked = false;
  state.last_tick = 0;
  state.start_tick = 0;
  state.started = false;
  state.moving = false;
  state.braking = false;
  state.tracking = {};
  state.course.stage = CourseStage::kNone;
  state.course.in_force = -1;
  state.course.number_in_force = state.course.tick_in_force = 0;
  state.hold_position = {};
  for (int i = 0; i < params.ball.mass_count; ++i) state.hold_position[at(i)] = params.motion[at(i)].at(0).position;
  state.position_steps = {};
  state.last_pulse = {};
  state.steps_issued = {};
  state.overload = {};
  state.operator_commands = 0;
  state.refusal = {};
  drop_plan(state);
  state.planned_motion_now = false;
  state.now = {};
  state.at_rest = true;
  reset_sensing(params, state);
  reset_governing(params, state);
}

void tick(const ControllerParams& params, ControllerState& state, const Inputs& inputs, StepCommand& steps) {
  const std::int64_t next = plus(inputs.tick, 1);

  const Order order = follow_last_tick(params, state, inputs.tick);
  // A tick repeated finds the next tick's motion where this one's was.
  for (int i = 0; i < params.ball.mass_count && !(order == Order::kRepeated && state.tracking.follows); ++i) {
    put(commanded(params, state, inputs.tick, i), at(i), state.now);
  }
  if (order != Order::kRepeated) sense(params, inputs, state);

  // Faults are stronger than the operator. While disarmed nothing is at stake: they are shown and forbid arming, but do
  // not latch.
  const std::uint32_t causes = causes_of(params, state, inputs, order);
  state.faults = state.mode == Mode::kDisarmed ? causes : state.faults | causes;
  const GuardState guards{state.faults == 0, at_rest_from(params, state, next), causes != 0};
  if (state.faults != 0) trip(state, guards);
  if (order != Order::kRepeated) watch_rest(params, inputs, state);
  obey(params, inputs, guards, state);
  advance_course(params, inputs, guards, state);
  const bool has_course = state.course.stage == CourseStage::kSearching;
  if (state.mode == Mode::kPending && !has_course) begin_move(params, state, guards, next);

  if (state.mode == Mode::kHalting && !state.moving) {
    if (const RefusalReport refusal = await_halt(params, inputs, state, next); refusal.reason != Refusal::kNone) {
      state.refusal = refusal;
      state.mode = next_mode(state.mode, Event::kDue, guards);
    }
  }
  if (state.mode == Mode::kHalting && halted(params, state)) state.mode = next_mode(state.mode, Event::kDue, guards);

  // The steps of a repeated tick are on their way already.
  clear(params, state, next, steps);
  if (state.moving && order != Order::kRepeated) command_steps(params, inputs, state, steps);

  // Making the steps may have revealed a fault.
  if (state.faults != 0) trip(state, guards);
  state.at_rest = at_rest_from(params, state, next);
  if (state.at_rest && state.moving && (state.braking || state.mode == Mode::kMoving)) hold(params, state, next);
  if (state.at_rest) state.mode = next_mode(state.mode, Event::kAtRest, guards);
  watch_start(params, inputs, state);
}

}  // namespace ballast::firmware
