#include <cmath>

#include "firmware/control/parts.h"
#include "firmware/motion/step_generator.h"

namespace ballast::firmware {

namespace {

StepError generate(const ControllerParams& params, const ControllerState& state, int i, StepCommand& out,
                   StepTrouble& trouble) {
  const MotorParams& motor = params.motor[at(i)];
  const StepTiming timing{params.timer_frequency_hz, params.control_period_s, motor.direction_setup_s,
                          bursts_per_motor(params.ball.mass_count)};
  return generate_steps(state.active[at(i)], profile_time(params, state, out.tick), params.motion[at(i)].at(0).position,
                        motor.steps_per_unit, motor.max_step_rate_hz, timing, i, out, &trouble);
}

}  // namespace

void clear(const ControllerParams& params, const ControllerState& state, std::int64_t tick, StepCommand& out) {
  out.tick = tick;
  out.motor_count = params.ball.mass_count;
  out.steps = {};
  out.position_steps = state.position_steps;
  out.last_pulse = state.last_pulse;
  out.burst_count = 0;
  out.bursts = {};
}

namespace {

// A motion that is commanded tick by tick may turn round where the tick before did not foresee it, with a pulse too
// near to the last one. Such pulses wait for the next tick whose start keeps the distance: that of the motor's step
// rate or of the driver's set-up time. A wait of twice that is no turn.
bool may_wait(const ControllerParams& params, ControllerState& state, int i) {
  const MotorParams& motor = params.motor[at(i)];
  const Wide distance_s = std::fmax(1 / motor.max_step_rate_hz, motor.direction_setup_s);
  return ++state.tracking.waiting_ticks[at(i)] <= 2 + static_cast<int>(2 * distance_s / params.control_period_s);
}

}  // namespace

bool generate_all(const ControllerParams& params, ControllerState& state, StepCommand& out) {
  for (int i = 0; i < params.ball.mass_count; ++i) {
    StepTrouble trouble;
    const StepError error = generate(params, state, i, out, trouble);
    if (error == StepError::kNone) {
      state.tracking.waiting_ticks[at(i)] = 0;
      continue;
    }
    if (state.tracking.follows && error == StepError::kTooFast && may_wait(params, state, i)) continue;
    if (state.overload.trouble.error == StepError::kNone) state.overload = {trouble, i, out.tick};
    return false;
  }
  return true;
}

void stop_overloaded(const ControllerParams& params, ControllerState& state, StepCommand& out) {
  begin_stop(params, state, out.tick);
  clear(params, state, out.tick, out);
  for (int i = 0; i < params.ball.mass_count; ++i) {
    StepTrouble trouble;
    if (generate(params, state, i, out, trouble) == StepError::kNone) continue;
    static_cast<void>(state.active[at(i)].set(commanded(params, state, out.tick, i).position, 0, nullptr, 0));
  }
}

void count(const StepCommand& steps, ControllerState& state) {
  for (int b = 0; b < steps.burst_count; ++b) {
    state.steps_issued[steps.bursts[at(b)].motor] += steps.bursts[at(b)].count;
  }
  state.position_steps = steps.position_steps;
  state.last_pulse = steps.last_pulse;
}

}  // namespace ballast::firmware
