// The plan in force: the last stop or move, and its prediction.
#pragma once

#include "firmware/control/inputs.h"
#include "firmware/control/params.h"
#include "firmware/control/state.h"
#include "firmware/motion/jerk_limited.h"

namespace ballast::firmware {

// Ticks from the request of a move to the tick that begins it: B, for profiles with so many pieces. The request's tick
// plans and predicts nothing; B - 1 ticks with kPredictionStepsHolding steps each follow, and the lead is B + 1 ticks:
// most_prediction_steps(B + 1, borders) <= kPredictionStepsHolding (B - 1). Under the governor a certificate is
// searched meanwhile.
constexpr int pending_ticks(int borders, int search_ticks = 0) {
  constexpr int kPerTick = kPredictionStepsHolding - 1;  // the lead grows by a step with each tick
  const int ticks = (most_prediction_steps(1, borders) + kPredictionStepsHolding + kPerTick - 1) / kPerTick;
  return search_ticks + 1 > ticks ? search_ticks + 1 : ticks;
}
// Without the governor.
inline constexpr int kMostPendingTicks = pending_ticks(kMaxMasses * kMaxPlannedPieces);  // 16

// Starts to predict the profiles in `active`, which begin with state.plan_tick, from this tick's sensed or estimated
// state. Where that is not known the prediction is complete at once: unknown.
void begin_prediction(const ControllerParams& params, const Inputs& inputs, ControllerState& state);

// Forgets the plan. Its prediction, if under way, ends without a result.
void drop_plan(ControllerState& state);
// The same of a pending move.
void drop_move(ControllerState& state);

}  // namespace ballast::firmware
