#include "firmware/control/plan.h"

#include <cmath>
#include <limits>

#include "firmware/control/controller.h"
#include "firmware/control/parts.h"

namespace ballast::firmware {

void begin_prediction(const ControllerParams& params, const Inputs& inputs, ControllerState& state) {
  const BallMotion ball = ball_motion(params, state, inputs.sensors);
  state.planned_motion_now = true;
  state.planned = false;
  state.plan = {};
  for (int i = 0; i < params.ball.mass_count; ++i) {
    state.plan.duration_s = std::fmax(state.plan.duration_s, state.active[at(i)].end_s());
  }
  if (!ball.known) {
    state.predictor.drop();
    state.planned = true;
    state.plan = {state.plan.duration_s, 0, std::numeric_limits<Real>::quiet_NaN(),
                  std::numeric_limits<Real>::infinity(), -1};
    return;
  }
  const auto lead_ticks = static_cast<int>(minus(state.plan_tick, inputs.tick));
  state.predictor.begin(ball.orientation, ball.angular_velocity_B_radps, state.now, params.control_period_s, lead_ticks,
                        state.active, params.ball.mass_count);
}

void drop_plan(ControllerState& state) {
  state.predictor.drop();
  state.planned = false;
  state.plan_tick = 0;
  state.plan = {};
}

void drop_move(ControllerState& state) {
  drop_plan(state);
  state.governing.start.stage = StartStage::kNone;
}

void predict(const ControllerParams& params, ControllerState& state) {
  if (state.planned_motion_now) return;
  search_start(params, state);
  state.predictor.advance(params.ball, params.static_friction, state.active,
                          state.moving ? kPredictionStepsMoving : kPredictionStepsHolding);
  if (state.planned || !state.predictor.complete()) return;
  state.planned = true;
  state.plan = state.predictor.result();
}

}  // namespace ballast::firmware
