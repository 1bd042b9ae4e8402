// The four calls of a control tick in one, for tests in which nobody waits for the steps.
#pragma once

#include "firmware/control/controller.h"

namespace ballast::firmware {

struct Outputs {
  StepCommand steps;  // of tick + 1
  ControllerStatus status;
};

inline void whole_tick(const ControllerParams& params, ControllerState& state, const Inputs& inputs, Outputs& outputs) {
  tick(params, state, inputs, outputs.steps);
  predict(params, state);
  measure(params, inputs, state);
  report(params, state, inputs, outputs.status);
}

}  // namespace ballast::firmware
