// Commands of the operator.
#pragma once

#include "firmware/control/inputs.h"
#include "firmware/control/params.h"
#include "firmware/control/state.h"
#include "firmware/safety/modes.h"

namespace ballast::firmware {

// Obeys the operator's command, if there is one, or keeps the reason why not.
void obey(const ControllerParams& params, const Inputs& inputs, const GuardState& guards, ControllerState& state);

}  // namespace ballast::firmware
