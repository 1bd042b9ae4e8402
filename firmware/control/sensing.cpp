// The ball's motion, estimated on board or sensed, and the contact force as the robot measures it.
#include "firmware/control/controller.h"
#include "firmware/control/parts.h"

namespace ballast::firmware {

namespace {

// A tilt known to this at 1 sigma says nothing of where masses push.
constexpr Real kMostTilt_rad = Real(0.5);

// Tells a valid estimate from one that says nothing, and from one that a bug or an overflow has spoilt.
bool usable(const Estimate& e) {
  return e.valid && e.tilt_sigma_rad < kMostTilt_rad && is_rotation(e.orientation) &&
         possible(e.angular_velocity_B_radps) && possible(e.gyro_bias_B_radps) && possible(e.position_W_m[0]) &&
         possible(e.position_W_m[1]);
}

// A sensed motion in the form of an estimate, without bands.
Estimate sensed(const BallMotion& ball) {
  Estimate out;
  out.valid = ball.known;
  out.orientation = ball.orientation;
  out.angular_velocity_B_radps = ball.angular_velocity_B_radps;
  return out;
}

}  // namespace

BallMotion ball_motion(const ControllerParams& params, const ControllerState& state, const Sensors& sensors) {
  if (params.estimation.estimated) {
    if (!usable(state.estimate)) return {};
    return {true, state.estimate.orientation, state.estimate.angular_velocity_B_radps};
  }
  if (!valid(params, sensors)) return {};
  return {true, attitude(sensors), sensors.gyro_B_radps};
}

void reset_sensing(const ControllerParams& params, ControllerState& state) {
  reset(params.ball, params.estimation, state.mass_meter);
  reset(params.ball, params.estimation, state.filter);
  reset(params.ball, params.estimation, state.contact_meter);
  state.measured_masses = {};
  state.estimate = {};
  state.measured = {};
  state.slip_friction = {};
}

void sense(const ControllerParams& params, const Inputs& inputs, ControllerState& state) {
  const EstimationParams& estimation = params.estimation;
  if (!estimation.measures_contact) return;  // validate(): nor is anything estimated
  measure_masses(params.ball, estimation, params.control_period_s, inputs.sensors, state.now, state.mass_meter,
                 state.measured_masses);
  if (!estimation.estimated) return;
  update(params.ball, estimation, params.control_period_s, inputs.sensors, state.now, inputs.tick, state.filter,
         state.estimate);
}

void measure(const ControllerParams& params, const Inputs& inputs, ControllerState& state) {
  if (!params.estimation.measures_contact) return;
  const BallMotion ball = ball_motion(params, state, inputs.sensors);
  if (!ball.known) {
    state.measured = {};
    return;
  }
  measure_contact(params.ball, params.estimation, params.control_period_s, inputs.sensors, state.now,
                  state.measured_masses, params.estimation.estimated ? state.estimate : sensed(ball), inputs.tick,
                  state.contact_meter, state.measured);
  if (state.moving) learn(state.measured, state.slip_friction);
}

}  // namespace ballast::firmware
