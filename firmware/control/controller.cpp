#include "firmware/control/controller.h"

#include <algorithm>
#include <cmath>

#include "firmware/motion/crossing.h"
#include "firmware/motion/jerk_limited.h"
#include "firmware/motion/motion_limits.h"
#include "firmware/motion/rail_ends.h"
#include "firmware/motion/step_generator.h"

namespace ballast::firmware {

namespace {

std::uint32_t bit(Fault fault) { return static_cast<std::uint32_t>(fault); }

std::size_t at(int i) { return static_cast<std::size_t>(i); }

// How this tick follows the one before.
enum class Order { kInOrder, kRepeated, kBroken };

Order order_of(const ControllerState& state, std::int64_t tick) {
  if (!state.ticked) return Order::kInOrder;
  if (tick == state.last_tick) return Order::kRepeated;
  return tick > state.last_tick && tick - 1 == state.last_tick ? Order::kInOrder : Order::kBroken;
}

bool stale(std::int64_t sample_tick, std::int64_t tick, int limit_ticks) {
  // Unsigned: the age of what never came does not fit the signed type, and that of a sample from the future wraps to a
  // huge one.
  const std::uint64_t age = static_cast<std::uint64_t>(tick) - static_cast<std::uint64_t>(sample_tick);
  return age > static_cast<std::uint64_t>(limit_ticks);
}

bool finite(const Vector3& v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }

Real length(const Quaternion& q) { return std::sqrt(q.w() * q.w() + q.x() * q.x() + q.y() * q.y() + q.z() * q.z()); }

// What passes is normalised before use, so this only tells an attitude from garbage: rounding, to single precision too,
// stays a thousand times below it, and a lost or broken component is far above. NaN and infinity fail the comparison.
constexpr auto kLengthTolerance = static_cast<Real>(1e-3);

bool valid(const Sensors& s) {
  return std::fabs(length(s.orientation) - 1) <= kLengthTolerance && finite(s.gyro_B_radps) &&
         finite(s.accelerometer_B_mps2);
}

// Microsteps of a target from the start: below 2^53, so that they can be counted; as validate() has it for the start.
constexpr Wide kMaxStepsFromZero = 1e15;

// Some mass stands at an end of its rail, where its switch is, and is commanded on over it. Away from it, or at rest,
// all is well.
bool driven_over_an_end(const Sensors& sensors, const MassMotion& commanded, int count) {
  for (int i = 0; i < count; ++i) {
    const unsigned switches = sensors.limit_switch[at(i)];
    const Wide velocity = commanded.velocity[at(i)];
    if (((switches & 1u) != 0 && velocity < 0) || ((switches & 2u) != 0 && velocity > 0)) return true;
  }
  return false;
}

// The world's faults present in this tick.
std::uint32_t causes_of(const ControllerParams& params, const Inputs& inputs, const MassMotion& now, Order order) {
  std::uint32_t causes = 0;
  if (order != Order::kInOrder) causes |= bit(Fault::kTickOutOfOrder);
  if (!valid(inputs.sensors)) causes |= bit(Fault::kSensorNotFinite);
  if (stale(inputs.sensors.tick, inputs.tick, params.sensor_stale_ticks)) causes |= bit(Fault::kSensorStale);
  if (stale(inputs.monitor.tick, inputs.tick, params.monitor_stale_ticks)) causes |= bit(Fault::kMonitorStale);
  if (inputs.monitor.tripped) causes |= bit(Fault::kMonitorTrip);
  if (driven_over_an_end(inputs.sensors, now, params.ball.mass_count)) causes |= bit(Fault::kEndSwitch);
  return causes;
}

// Tick numbers come from outside: sums and differences wrap, they do not overflow.
std::int64_t plus(std::int64_t tick, int n) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(tick) + static_cast<std::uint64_t>(n));
}
std::int64_t minus(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}

// Profile time at the start of a tick.
Wide profile_time(const ControllerParams& params, const ControllerState& state, std::int64_t tick) {
  return static_cast<Wide>(minus(tick, state.start_tick)) * params.control_period_s;
}

ProfilePoint commanded(const ControllerParams& params, const ControllerState& state, std::int64_t tick, int i) {
  if (!state.moving) return {state.hold_position[at(i)], 0, 0};
  return state.active[at(i)].at(profile_time(params, state, tick));
}

bool at_rest_from(const ControllerParams& params, const ControllerState& state, std::int64_t tick) {
  if (!state.moving) return true;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    if (!state.active[at(i)].at_rest_from(profile_time(params, state, tick))) return false;
  }
  return true;
}

// From now on the masses stand where their profiles are at the start of `tick`.
void hold(const ControllerParams& params, ControllerState& state, std::int64_t tick) {
  for (int i = 0; i < params.ball.mass_count; ++i) {
    state.hold_position[at(i)] = commanded(params, state, tick, i).position;
  }
  state.moving = false;
  state.braking = false;
}

// Stop from this state in duration_s or, if that is less, the shortest time. False, and `profile` as it was or not at
// rest in the end: not a stop.
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

Wide final_position(const Profile& profile) { return profile.cubic(profile.piece_count()).position; }

RefusalReport refused(Refusal reason, int motor = -1, Wide value = 0, int piece = -1) {
  return {reason, motor, piece, value};
}

// The motion from where the masses stand, into `active`; nothing else changes.
RefusalReport prepare_motion(const ControllerParams& params, ControllerState& state) {
  for (int i = 0; i < params.ball.mass_count; ++i) {
    state.active[at(i)] = params.motion[at(i)];
    if (!state.started) continue;  // validate() has seen it
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

// The move, into `active`; nothing else changes. The masses hold.
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
    const Wide steps = (target - params.motion[at(i)].at(0).position) * params.motor[at(i)].steps_per_unit;
    if (!(std::fabs(steps) <= kMaxStepsFromZero)) return refused(Refusal::kTarget, i, target);
    if (!plan_move(distance(i), motion_limits(params, i), 0, pieces)) {
      return refused(Refusal::kNotPlanned, i, distance(i));
    }
    duration_s = std::fmax(duration_s, pieces.duration_s() / move.speed_fraction);
  }
  for (int i = 0; i < count; ++i) {
    Profile& profile = state.active[at(i)];
    const Wide from = state.hold_position[at(i)];
    const MotionLimits limits = motion_limits(params, i);
    if (!plan_move(distance(i), limits, duration_s, pieces) ||
        !profile.set(from, 0, pieces.piece.data(), pieces.count)) {
      return refused(Refusal::kNotPlanned, i, distance(i));
    }
    // Checked by code that did not plan it; 1e-12: the rounding of seven pieces' sums, with room.
    const Wide miss = std::fabs(final_position(profile) - (from + distance(i)));
    if (!profile.at_rest_from(profile.end_s()) || !check_limits(profile, limits).ok() ||
        !(miss <= 1e-12 * (std::fabs(from) + std::fabs(distance(i))))) {
      return refused(Refusal::kNotPlanned, i, distance(i));
    }
  }
  return {};
}

// What is in `active` is in force from the start of `next`.
void begin(ControllerState& state, std::int64_t next) {
  state.start_tick = next;
  state.started = true;
  state.moving = true;
  state.braking = false;
}

// State from which mass i stops at the start of `next`. An acceleration that raises the speed takes time to fade at the
// greatest jerk, and raises it by a^2 / (2 jerk) meanwhile. Near the motor's step rate it therefore begins lower, so
// that the stop does not pass that rate.
ProfilePoint stop_start(const ControllerParams& params, const ControllerState& state, std::int64_t next, int i) {
  ProfilePoint p = commanded(params, state, next, i);
  const MotionLimits limits = motion_limits(params, i);
  const Wide left = std::fmax(limits.max_velocity - std::fabs(p.velocity), 0);
  const Wide most = std::sqrt(2 * limits.max_jerk * left);
  if (p.acceleration * p.velocity > 0 && std::fabs(p.acceleration) > most) {
    p.acceleration = std::copysign(most, p.velocity);
  }
  return p;
}

// From the start of `next` all masses stop, in the time the slowest of them needs.
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
    if (stop(profile, p, limits, slowest_s) && on_rail(params.ball, i, final_position(profile))) continue;
    if (stop(profile, p, limits, 0)) continue;
    state.faults |= bit(Fault::kInternal);
    // Where the last step left it; such a position fits any profile.
    const Wide position = params.motion[at(i)].at(0).position +
                          static_cast<Wide>(state.position_steps[at(i)]) / params.motor[at(i)].steps_per_unit;
    static_cast<void>(profile.set(position, 0, nullptr, 0));
  }
  state.start_tick = next;
  state.braking = true;
}

void clear(const ControllerParams& params, const ControllerState& state, std::int64_t tick, StepCommand& out) {
  out.tick = tick;
  out.motor_count = params.ball.mass_count;
  out.steps = {};
  out.position_steps = state.position_steps;
  out.last_pulse = state.last_pulse;
  out.burst_count = 0;
  out.bursts = {};
}

StepError generate(const ControllerParams& params, const ControllerState& state, int i, StepCommand& out,
                   StepTrouble& trouble) {
  const MotorParams& motor = params.motor[at(i)];
  const StepTiming timing{params.timer_frequency_hz, params.control_period_s, motor.direction_setup_s,
                          bursts_per_motor(params.ball.mass_count)};
  return generate_steps(state.active[at(i)], profile_time(params, state, out.tick), params.motion[at(i)].at(0).position,
                        motor.steps_per_unit, motor.max_step_rate_hz, timing, i, out, &trouble);
}

// Steps of all motors, into a cleared command. False: some motor's profile cannot be stepped. The first such overload
// since the faults were cleared is kept.
bool generate_all(const ControllerParams& params, ControllerState& state, StepCommand& out) {
  for (int i = 0; i < params.ball.mass_count; ++i) {
    StepTrouble trouble;
    if (generate(params, state, i, out, trouble) == StepError::kNone) continue;
    if (state.overload.trouble.error == StepError::kNone) state.overload = {trouble, i, out.tick};
    return false;
  }
  return true;
}

// After an overload: all masses stop, and a motor whose stop cannot be stepped either holds. validate() admits no
// motion that comes here; this is the second line of defence.
void stop_overloaded(const ControllerParams& params, ControllerState& state, StepCommand& out) {
  begin_stop(params, state, out.tick);
  clear(params, state, out.tick, out);
  for (int i = 0; i < params.ball.mass_count; ++i) {
    StepTrouble trouble;
    if (generate(params, state, i, out, trouble) == StepError::kNone) continue;
    static_cast<void>(state.active[at(i)].set(commanded(params, state, out.tick, i).position, 0, nullptr, 0));
  }
}

// False: not a command, or one we do not know.
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
    case OperatorCommand::kNone:
      break;
  }
  return false;
}

Quaternion unit(const Quaternion& q) {
  const Real norm = length(q);
  return {q.w() / norm, q.x() / norm, q.y() / norm, q.z() / norm};
}

constexpr Real kUnknown = std::numeric_limits<Real>::quiet_NaN();

// N and f_s at the start of this tick.
void estimate(const ControllerParams& params, const Sensors& sensors, const MassMotion& masses,
              ControllerStatus& status) {
  RollingForces& f = status.predicted;
  if (valid(sensors)) {
    f = rolling_forces(params.ball, unit(sensors.orientation), sensors.gyro_B_radps, masses);
  } else {
    f.angular_acceleration_B_radps2 = Vector3(kUnknown, kUnknown, kUnknown);
    f.normal_force_n = kUnknown;
    f.friction_force_W_n = Vector2(kUnknown, kUnknown);
    f.static_friction_n = kUnknown;
  }
  friction_use(f, params.static_friction, status.mu_required, status.margin);
}

// Starts to predict the profiles that begin at the start of state.plan_tick, from this tick's sensed state. Without one
// the prediction is complete at once: unknown.
void begin_prediction(const ControllerParams& params, const Inputs& inputs, ControllerState& state) {
  const Sensors& sensors = inputs.sensors;
  state.planned_motion_now = true;
  state.planned = false;
  state.plan = {};
  for (int i = 0; i < params.ball.mass_count; ++i) {
    state.plan.duration_s = std::fmax(state.plan.duration_s, state.active[at(i)].end_s());
  }
  if (!valid(sensors)) {
    state.predictor.drop();
    state.planned = true;
    state.plan = {state.plan.duration_s, 0, kUnknown, std::numeric_limits<Real>::infinity(), -1};
    return;
  }
  const auto lead_ticks = static_cast<int>(minus(state.plan_tick, inputs.tick));
  state.predictor.begin(unit(sensors.orientation), sensors.gyro_B_radps, state.now, params.control_period_s, lead_ticks,
                        state.active, params.ball.mass_count);
}

void drop_plan(ControllerState& state) {
  state.predictor.drop();
  state.planned = false;
  state.plan_tick = 0;
  state.plan = {};
}

// The tick whose start a move begins with that is asked for now: its prediction is complete by then.
std::int64_t move_begins(const ControllerParams& params, const ControllerState& state, std::int64_t tick) {
  int borders = 0;
  for (int i = 0; i < params.ball.mass_count; ++i) borders += state.active[at(i)].piece_count();
  return plus(tick, pending_ticks(borders) + 1);
}

// Trips if a fault allows nothing else. A pending move is cancelled.
void trip(ControllerState& state, const GuardState& guards) {
  const Mode after = next_mode(state.mode, Event::kFault, guards);
  if (state.mode == Mode::kPending && after != state.mode) {
    drop_plan(state);
    state.refusal = refused(Refusal::kCancelled);
  }
  state.mode = after;
}

// Obeys the operator, or says why not.
RefusalReport obey(const ControllerParams& params, const Inputs& inputs, Mode after, ControllerState& state) {
  const std::int64_t next = plus(inputs.tick, 1);
  const Mode before = state.mode;
  if (after == before) return refused(Refusal::kMode);
  if (after == Mode::kRunning || after == Mode::kPending) {
    // Both write the profiles that a prediction under way still reads.
    if (!state.planned) drop_plan(state);
    const RefusalReport refusal = after == Mode::kRunning ? prepare_motion(params, state)
                                                          : prepare_move(params, inputs.operator_command.move, state);
    if (refusal.reason != Refusal::kNone) return refusal;
  }
  if (after == Mode::kRunning) begin(state, next);
  if (after == Mode::kPending) {
    state.plan_tick = move_begins(params, state, inputs.tick);
    begin_prediction(params, inputs, state);
  }
  if (before == Mode::kPending) drop_plan(state);
  if (before == Mode::kTripped) {
    state.faults = 0;
    state.overload = {};
  }
  state.mode = after;
  return {};
}

}  // namespace

MotionLimits motion_limits(const ControllerParams& params, int mass) {
  const MotorParams& motor = params.motor[at(mass)];
  return {motor.max_step_rate_hz / std::fabs(motor.steps_per_unit), motor.max_acceleration, motor.max_jerk};
}

void reset(const ControllerParams& params, ControllerState& state) {
  // Member by member: a temporary of the whole state would need 50 kB of stack. The profiles are not read before
  // `moving`.
  state.mode = Mode::kDisarmed;
  state.faults = 0;
  state.ticked = false;
  state.last_tick = 0;
  state.start_tick = 0;
  state.started = false;
  state.moving = false;
  state.braking = false;
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
}

void tick(const ControllerParams& params, ControllerState& state, const Inputs& inputs, StepCommand& steps) {
  const std::int64_t next = plus(inputs.tick, 1);

  // Continuity. Commands were issued for every tick up to last_tick + 1, whose end is the start of last_tick + 2.
  const Order order = order_of(state, inputs.tick);
  if (order == Order::kBroken && state.moving) hold(params, state, plus(state.last_tick, 2));
  if (order == Order::kBroken) {
    // How long ago the last pulses were is not known; not later than now.
    for (LastPulse& last : state.last_pulse) last.tick = inputs.tick;
  }
  state.ticked = true;
  state.last_tick = inputs.tick;
  state.planned_motion_now = false;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    put(commanded(params, state, inputs.tick, i), at(i), state.now);
  }

  // Faults, events, mode. While disarmed nothing is at stake: faults are shown and forbid arming, but do not latch.
  const std::uint32_t causes = causes_of(params, inputs, state.now, order);
  state.faults = state.mode == Mode::kDisarmed ? causes : state.faults | causes;
  const GuardState guards{state.faults == 0, at_rest_from(params, state, next), causes != 0};
  if (state.faults != 0) trip(state, guards);
  if (Event event{}; event_of(inputs.operator_command.command, event)) {
    ++state.operator_commands;
    state.refusal = obey(params, inputs, next_mode(state.mode, event, guards), state);
  }
  if (state.mode == Mode::kPending && next == state.plan_tick) {
    state.mode = next_mode(state.mode, Event::kDue, guards);
    begin(state, next);
  }

  // Steps of the next tick; those of a repeated tick are on their way already.
  clear(params, state, next, steps);
  if (state.moving && order != Order::kRepeated) {
    bool stop_begins = false;
    if (state.mode != Mode::kRunning && state.mode != Mode::kMoving && !state.braking) {
      begin_stop(params, state, next);
      stop_begins = true;
    }
    if (!generate_all(params, state, steps)) {
      state.faults |= bit(Fault::kStepOverload);
      stop_overloaded(params, state, steps);
      stop_begins = true;
    }
    if (stop_begins) {
      state.plan_tick = next;
      begin_prediction(params, inputs, state);
    }
    for (int b = 0; b < steps.burst_count; ++b) {
      state.steps_issued[steps.bursts[at(b)].motor] += steps.bursts[at(b)].count;
    }
    state.position_steps = steps.position_steps;
    state.last_pulse = steps.last_pulse;
  }
  // What turned up while making the steps.
  if (state.faults != 0) trip(state, guards);
  state.at_rest = at_rest_from(params, state, next);
  if (state.at_rest && state.moving && (state.braking || state.mode == Mode::kMoving)) hold(params, state, next);
  if (state.at_rest) state.mode = next_mode(state.mode, Event::kAtRest, guards);
}

void predict(const ControllerParams& params, ControllerState& state) {
  if (state.planned_motion_now) return;
  state.predictor.advance(params.ball, params.static_friction, state.active,
                          state.moving ? kPredictionStepsMoving : kPredictionStepsHolding);
  if (state.planned || !state.predictor.complete()) return;
  state.planned = true;
  state.plan = state.predictor.result();
}

void report(const ControllerParams& params, const ControllerState& state, const Inputs& inputs,
            ControllerStatus& status) {
  estimate(params, inputs.sensors, state.now, status);
  status.tick = inputs.tick;
  status.scenario_id = params.scenario_id;
  status.mode = state.mode;
  status.at_rest = state.at_rest;
  status.faults = state.faults;
  status.motor_count = params.ball.mass_count;
  status.commanded_position = state.now.position;
  status.commanded_velocity = state.now.velocity;
  const std::int64_t next = plus(inputs.tick, 1);
  for (int i = 0; i < params.ball.mass_count; ++i) status.next[at(i)] = commanded(params, state, next, i);
  status.steps_issued = state.steps_issued;
  status.overload = state.overload;
  status.operator_commands = state.operator_commands;
  status.refusal = state.refusal;
  status.planned = state.planned;
  status.plan_tick = state.plan_tick;
  status.plan = state.plan;
}

}  // namespace ballast::firmware
