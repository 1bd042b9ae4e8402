#include "firmware/control/controller.h"

#include <cmath>

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
constexpr Real kLengthTolerance = 1e-3;

bool valid(const Sensors& s) {
  return std::fabs(length(s.orientation) - 1) <= kLengthTolerance && finite(s.gyro_B_radps) &&
         finite(s.accelerometer_B_mps2);
}

// The world's faults present in this tick.
std::uint32_t causes_of(const ControllerParams& params, const Inputs& inputs, Order order) {
  std::uint32_t causes = 0;
  if (order != Order::kInOrder) causes |= bit(Fault::kTickOutOfOrder);
  if (!valid(inputs.sensors)) causes |= bit(Fault::kSensorNotFinite);
  if (stale(inputs.sensors.tick, inputs.tick, params.sensor_stale_ticks)) causes |= bit(Fault::kSensorStale);
  if (stale(inputs.monitor.tick, inputs.tick, params.monitor_stale_ticks)) causes |= bit(Fault::kMonitorStale);
  if (inputs.monitor.tripped) causes |= bit(Fault::kMonitorTrip);
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
Real profile_time(const ControllerParams& params, const ControllerState& state, std::int64_t tick) {
  return static_cast<Real>(minus(tick, state.start_tick)) * params.control_period_s;
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

// Constant deceleration to rest. False: not a profile (numbers out of range).
bool brake(Profile& profile, Real position, Real velocity, Real deceleration) {
  const Real rate = velocity > 0 ? -deceleration : deceleration;
  const ProfilePiece piece{std::fabs(velocity) / deceleration, rate, rate};
  if (!(piece.duration_s > 0)) return profile.set(position, 0, nullptr, 0);
  return profile.set(position, velocity, &piece, 1);
}

void begin_motion(const ControllerParams& params, ControllerState& state, std::int64_t next) {
  for (int i = 0; i < params.ball.mass_count; ++i) {
    state.active[at(i)] = params.motion[at(i)];
    if (state.started && !state.active[at(i)].rebase(state.hold_position[at(i)], 0)) {
      state.faults |= bit(Fault::kInternal);
      return;  // still holding
    }
  }
  state.start_tick = next;
  state.started = true;
  state.moving = true;
  state.braking = false;
}

void begin_stop(const ControllerParams& params, ControllerState& state, std::int64_t next) {
  for (int i = 0; i < params.ball.mass_count; ++i) {
    const ProfilePoint p = commanded(params, state, next, i);
    if (!brake(state.active[at(i)], p.position, p.velocity, params.motor[at(i)].max_acceleration)) {
      state.faults |= bit(Fault::kInternal);
      // Where the last step left it; such a position fits any profile.
      const Real position = params.motion[at(i)].at(0).position +
                            static_cast<Real>(state.position_steps[at(i)]) / params.motor[at(i)].steps_per_unit;
      static_cast<void>(state.active[at(i)].set(position, 0, nullptr, 0));
    }
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
                   StepTrouble* trouble = nullptr) {
  const MotorParams& motor = params.motor[at(i)];
  const bool overloaded = (state.faults & bit(Fault::kStepOverload)) != 0;
  return generate_steps(state.active[at(i)], profile_time(params, state, out.tick), params.motion[at(i)].at(0).position,
                        motor.steps_per_unit, motor.max_step_rate_hz,
                        {params.timer_frequency_hz, params.control_period_s, motor.direction_setup_s, overloaded}, i,
                        out, trouble);
}

// False: some motor's profile cannot be stepped, and the first such overload is kept.
bool generate_all(const ControllerParams& params, ControllerState& state, StepCommand& out) {
  for (int i = 0; i < params.ball.mass_count; ++i) {
    StepTrouble trouble;
    if (generate(params, state, i, out, &trouble) == StepError::kNone) continue;
    if (state.overload.trouble.error == StepError::kNone) state.overload = {trouble, i, out.tick};
    return false;
  }
  return true;
}

// Largest speed whose steps can surely be issued: just under the motor's rate, and a tick's worth of pulses.
Real feasible_speed(const ControllerParams& params, int i) {
  const MotorParams& motor = params.motor[at(i)];
  const Real rate_hz = std::fmin(motor.max_step_rate_hz, (kMaxStepsPerTick - 1) / params.control_period_s);
  return 0.999 * rate_hz / std::fabs(motor.steps_per_unit);
}

// Something cannot be stepped: everything brakes from the commanded state, each motor as well as it can. Never more
// than three tries a motor; the last, holding, needs no pulses.
void generate_overloaded(const ControllerParams& params, ControllerState& state, StepCommand& out) {
  begin_stop(params, state, out.tick);
  clear(params, state, out.tick, out);
  for (int i = 0; i < params.ball.mass_count; ++i) {
    if (generate(params, state, i, out) == StepError::kNone) continue;
    const ProfilePoint p = commanded(params, state, out.tick, i);
    const Real speed = std::fmin(std::fabs(p.velocity), feasible_speed(params, i));
    const bool slower =
        brake(state.active[at(i)], p.position, std::copysign(speed, p.velocity), params.motor[at(i)].max_acceleration);
    if (slower && generate(params, state, i, out) == StepError::kNone) continue;
    static_cast<void>(state.active[at(i)].set(p.position, 0, nullptr, 0));
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
    case OperatorCommand::kNone:
      break;
  }
  return false;
}

void predict(const ControllerParams& params, const Sensors& sensors, const MassMotion& masses,
             ControllerStatus& status) {
  RollingForces& f = status.predicted;
  if (valid(sensors)) {
    const Real norm = length(sensors.orientation);
    const Quaternion q(sensors.orientation.w() / norm, sensors.orientation.x() / norm, sensors.orientation.y() / norm,
                       sensors.orientation.z() / norm);
    f = rolling_forces(params.ball, q, sensors.gyro_B_radps, masses);
  } else {
    constexpr Real kUnknown = std::numeric_limits<Real>::quiet_NaN();
    f.angular_acceleration_B_radps2 = Vector3(kUnknown, kUnknown, kUnknown);
    f.normal_force_n = kUnknown;
    f.friction_force_W_n = Vector2(kUnknown, kUnknown);
    f.static_friction_n = kUnknown;
  }
  if (!(f.normal_force_n > 0)) {
    status.mu_required = std::numeric_limits<Real>::infinity();
    status.margin = -1;
    return;
  }
  status.mu_required = f.static_friction_n / f.normal_force_n;
  status.margin = std::isinf(params.static_friction) ? 1 : 1 - status.mu_required / params.static_friction;
}

}  // namespace

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
}

void tick(const ControllerParams& params, ControllerState& state, const Inputs& inputs, Outputs& outputs) {
  const std::int64_t next = plus(inputs.tick, 1);
  StepCommand& steps = outputs.steps;
  ControllerStatus& status = outputs.status;

  // Continuity. Commands were issued for every tick up to last_tick + 1, whose end is the start of last_tick + 2.
  const Order order = order_of(state, inputs.tick);
  if (order == Order::kBroken && state.moving) hold(params, state, plus(state.last_tick, 2));
  if (order == Order::kBroken) {
    // How long ago the last pulses were is not known; not later than now.
    for (LastPulse& last : state.last_pulse) last.tick = inputs.tick;
  }
  state.ticked = true;
  state.last_tick = inputs.tick;

  MassMotion now;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    const ProfilePoint p = commanded(params, state, inputs.tick, i);
    now.position[at(i)] = p.position;
    now.velocity[at(i)] = p.velocity;
    now.acceleration[at(i)] = p.acceleration;
  }

  // Faults, events, mode. While disarmed nothing is at stake: faults are shown and forbid arming, but do not latch.
  const std::uint32_t causes = causes_of(params, inputs, order);
  state.faults = state.mode == Mode::kDisarmed ? causes : state.faults | causes;
  const GuardState guards{state.faults == 0, at_rest_from(params, state, next), causes != 0};
  if (state.faults != 0) state.mode = next_mode(state.mode, Event::kFault, guards);
  if (Event event{}; event_of(inputs.operator_command, event)) {
    const Mode before = state.mode;
    state.mode = next_mode(before, event, guards);
    if (before == Mode::kTripped && state.mode == Mode::kDisarmed) {
      state.faults = 0;
      state.overload = {};
    }
    if (before == Mode::kArmed && state.mode == Mode::kRunning) begin_motion(params, state, next);
  }

  // Steps of the next tick; those of a repeated tick are on their way already.
  clear(params, state, next, steps);
  if (state.moving && order != Order::kRepeated) {
    if (state.mode != Mode::kRunning && !state.braking) begin_stop(params, state, next);
    if (!generate_all(params, state, steps)) {
      state.faults |= bit(Fault::kStepOverload);
      generate_overloaded(params, state, steps);
    }
    for (int b = 0; b < steps.burst_count; ++b) {
      state.steps_issued[steps.bursts[at(b)].motor] += steps.bursts[at(b)].count;
    }
    state.position_steps = steps.position_steps;
    state.last_pulse = steps.last_pulse;
  }
  // What turned up while making the steps.
  if (state.faults != 0) state.mode = next_mode(state.mode, Event::kFault, guards);
  const bool at_rest = at_rest_from(params, state, next);
  if (at_rest && state.moving && state.braking) hold(params, state, next);
  if (at_rest) state.mode = next_mode(state.mode, Event::kAtRest, guards);

  predict(params, inputs.sensors, now, status);
  status.tick = inputs.tick;
  status.scenario_id = params.scenario_id;
  status.mode = state.mode;
  status.at_rest = at_rest;
  status.faults = state.faults;
  status.motor_count = params.ball.mass_count;
  status.commanded_position = now.position;
  status.commanded_velocity = now.velocity;
  status.steps_issued = state.steps_issued;
  status.overload = state.overload;
}

}  // namespace ballast::firmware
