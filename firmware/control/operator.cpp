#include <cmath>

#include "firmware/control/parts.h"
#include "firmware/control/plan.h"
#include "firmware/governor/halt.h"
#include "firmware/motion/motion_limits.h"
#include "firmware/motion/rail_ends.h"

namespace ballast::firmware {

namespace {

// Returns false if there is no command, or an unknown one.
bool event_of(OperatorCommand command, Event& event) {
  switch (command) {
    case OperatorCommand::kArm:
      event = Event::kArm;
      return true;
    case OperatorCommand::kStart:
      event = Event::kStart;
      return true;
    case OperatorCommand::kStop:
      event = Event::kStop;
      return true;
    case OperatorCommand::kReset:
      event = Event::kReset;
      return true;
    case OperatorCommand::kMove:
      event = Event::kMove;
      return true;
    case OperatorCommand::kHalt:
      event = Event::kHalt;
      return true;
    case OperatorCommand::kGo:  // take_part()
    case OperatorCommand::kNone:
      break;
  }
  return false;
}

// The command asks for what is so already: a stop while the masses stop, a halt while the ball is halted or where it
// rests under masses that hold. Nothing changes then.
bool is_obeyed(const ControllerParams& params, const ControllerState& state, Event event) {
  if (event == Event::kStop) return state.mode == Mode::kStopping;
  if (event != Event::kHalt) return false;
  return state.mode == Mode::kHalting || (state.mode == Mode::kArmed && params.governor.on && halted(params, state));
}

RefusalReport refused(Refusal reason, int motor = -1, Wide value = 0, int piece = -1) {
  return {reason, motor, piece, value, 0};
}

// Puts the motion, begun from where the masses stand, into `active`. Nothing else changes.
RefusalReport prepare_motion(const ControllerParams& params, ControllerState& state) {
  for (int i = 0; i < params.ball.mass_count; ++i) {
    state.active[at(i)] = params.motion[at(i)];
    if (!state.started) continue;  // checked by validate()
    if (!state.active[at(i)].rebase(state.hold_position[at(i)], 0)) {
      return refused(Refusal::kNotPlanned, i, state.hold_position[at(i)]);
    }
    const LimitBreach breach = check_limits(state.active[at(i)], motion_limits(params, i));
    if (breach.what == Limited::kVelocity) return refused(Refusal::kVelocity, i, breach.value, breach.piece);
    if (breach.what == Limited::kAcceleration) return refused(Refusal::kAcceleration, i, breach.value, breach.piece);
    if (breach.what == Limited::kJerk) return refused(Refusal::kJerk, i, breach.value, breach.piece);
    const LeavesRail leaves = leaves_rail(params.ball, i, state.active[at(i)]);
    if (leaves.piece >= 0) return refused(Refusal::kRailEnd, i, leaves.position, leaves.piece);
  }
  return {};
}

// Puts the move into `active`. Nothing else changes; the masses hold.
RefusalReport prepare_move(const ControllerParams& params, const MoveRequest& move, ControllerState& state) {
  const int count = params.ball.mass_count;
  if (move.masses == 0) return refused(Refusal::kNoMass);
  for (int i = count; i < 32; ++i) {
    if ((move.masses >> i & 1u) != 0) return refused(Refusal::kUnknownMass, i, i);
  }
  if (!(move.speed_fraction > 0 && move.speed_fraction <= 1)) {
    return refused(Refusal::kSpeedFraction, -1, move.speed_fraction);
  }
  const auto distance = [&](int i) {
    const bool moves = (move.masses >> i & 1u) != 0;
    return moves ? move.target_position[at(i)] - state.hold_position[at(i)] : Wide{0};
  };
  PlannedPieces pieces;
  Wide duration_s = 0;
  for (int i = 0; i < count; ++i) {
    if ((move.masses >> i & 1u) == 0) continue;
    const Wide target = move.target_position[at(i)];
    if (!std::isfinite(target)) return refused(Refusal::kTarget, i, target);
    const RailEnds ends = rail_ends(params.ball, i);
    const Wide swing = params.motor[at(i)].swing;
    if (target < ends.lower + swing) return refused(Refusal::kLowerEnd, i, ends.lower + swing);
    if (!(target <= ends.upper - swing)) return refused(Refusal::kUpperEnd, i, ends.upper - swing);
    if (!countable_steps(params, i, target)) return refused(Refusal::kTarget, i, target);
    if (!plan_move(distance(i), motion_limits(params, i), 0, pieces)) {
      return refused(Refusal::kNotPlanned, i, distance(i));
    }
    duration_s = std::fmax(duration_s, pieces.duration_s() / move.speed_fraction);
  }
  if (const Wide most_s = longest_governed_move_s(params, state); !(duration_s <= most_s)) {
    return {Refusal::kNotCertified, -1, -1, duration_s, most_s};
  }
  for (int i = 0; i < count; ++i) {
    Profile& profile = state.active[at(i)];
    const Wide from = state.hold_position[at(i)];
    const MotionLimits limits = motion_limits(params, i);
    if (!plan_move(distance(i), limits, duration_s, pieces) ||
        !profile.set(from, 0, pieces.piece.data(), pieces.count)) {
      return refused(Refusal::kNotPlanned, i, distance(i));
    }
    // Checked by code that did not plan it. 1e-12 is a few hundred times the rounding of seven pieces' sums.
    const Wide miss = std::fabs(profile.final_position() - (from + distance(i)));
    if (!profile.at_rest_from(profile.end_s()) || !check_limits(profile, limits).ok() ||
        !(miss <= 1e-12 * (std::fabs(from) + std::fabs(distance(i))))) {
      return refused(Refusal::kNotPlanned, i, distance(i));
    }
  }
  return {};
}

// Returns the tick at whose start a move requested now begins. Its prediction is complete by then, and under the
// governor the search for its certificate.
std::int64_t move_begins(const ControllerParams& params, const ControllerState& state, std::int64_t tick) {
  int borders = 0;
  for (int i = 0; i < params.ball.mass_count; ++i) borders += state.active[at(i)].piece_count();
  return plus(tick, pending_ticks(borders, ticks_of_move_search(params, state)) + 1);
}

// Obeys a command that leads to the mode `after`, or returns the reason why not.
RefusalReport follow(const ControllerParams& params, const Inputs& inputs, Mode after, ControllerState& state) {
  const std::int64_t next = plus(inputs.tick, 1);
  const Mode before = state.mode;
  if (after == before) return refused(Refusal::kMode);
  if (after == Mode::kArmed && before == Mode::kDisarmed && params.estimation.estimated &&
      !ball_motion(params, state, inputs.sensors).known) {
    return refused(Refusal::kNoEstimate);
  }
  if (after == Mode::kHalting) {
    // Only the governor knows how the ball is brought to rest inside the cone.
    if (before == Mode::kArmed ? !params.governor.on : !state.governing.governs) return refused(Refusal::kMode);
    if (before == Mode::kArmed) {
      ask_for_halt(params, inputs, state);
    } else {
      begin_halt(state);
    }
  }
  if (after == Mode::kRunning || after == Mode::kPending) {
    // Both write the profiles that a prediction under way still reads.
    if (!state.planned) drop_plan(state);
    const RefusalReport refusal = after == Mode::kRunning ? prepare_motion(params, state)
                                                          : prepare_move(params, inputs.operator_command.move, state);
    if (refusal.reason != Refusal::kNone) return refusal;
  }
  if (after == Mode::kRunning) {
    if (const RefusalReport refusal = judge_start(params, state); refusal.reason != Refusal::kNone) return refusal;
    const bool tracks = params.tracking.samples > 0 && !state.started;
    if (params.governor.on) begin_governing(params, inputs, state, next);
    const bool governs = params.governor.on;
    begin(state, next);
    if (tracks || governs) begin_tracking(state, next, tracks);
    state.governing.governs = governs;
  }
  if (after == Mode::kPending) {
    state.plan_tick = move_begins(params, state, inputs.tick);
    begin_prediction(params, inputs, state);
    begin_move_search(params, inputs, state);
  }
  if (before == Mode::kPending) drop_move(state);
  if (before == Mode::kTripped) {
    state.faults = 0;
    state.overload = {};
  }
  state.mode = after;
  return {};
}

}  // namespace

bool countable_steps(const ControllerParams& params, int i, Wide position) {
  // Below 2^53; validate() has the same for the start.
  constexpr Wide kMaxStepsFromZero = 1e15;
  const Wide steps = (position - params.motion[at(i)].at(0).position) * params.motor[at(i)].steps_per_unit;
  return std::fabs(steps) <= kMaxStepsFromZero;
}

void watch_rest(const ControllerParams& params, const Inputs& inputs, ControllerState& state) {
  if (!params.governor.on || state.mode == Mode::kHalting || state.mode == Mode::kStopping) return;
  int& slow_ticks = state.governing.halt.slow_ticks;
  bool slow = false;
  // A ball that is held before tick 0 does not rest by itself.
  if (state.mode == Mode::kArmed && inputs.tick >= 0) {
    if (const BallMotion motion = ball_motion(params, state, inputs.sensors); motion.known) {
      RobotState robot;
      robot.orientation = motion.orientation;
      robot.angular_velocity_B_radps = motion.angular_velocity_B_radps;
      slow = speed_mps(params.ball, robot) < rest_speed_mps(params.ball);
    }
  }
  if (!slow) {
    slow_ticks = 0;
  } else if (!halted(params, state)) {
    ++slow_ticks;
  }
}

void obey(const ControllerParams& params, const Inputs& inputs, const GuardState& guards, ControllerState& state) {
  if (inputs.operator_command.command == OperatorCommand::kGo) {
    ++state.operator_commands;
    state.refusal = take_part(params, inputs.operator_command.course, state);
    return;
  }
  Event event{};
  if (!event_of(inputs.operator_command.command, event)) return;
  ++state.operator_commands;
  if (is_obeyed(params, state, event)) {
    state.refusal = {};
    return;
  }
  state.refusal = follow(params, inputs, next_mode(state.mode, event, guards), state);
}

}  // namespace ballast::firmware
