// Step pulses of all motors for one control tick.
#pragma once

#include "firmware/control/params.h"
#include "firmware/control/state.h"

namespace ballast::firmware {

// Empties `out`: a command for `tick` without pulses.
void clear(const ControllerParams& params, const ControllerState& state, std::int64_t tick, StepCommand& out);

// Makes the steps of all motors, into a cleared command. False: some motor's profile cannot be stepped. The first such
// overload since the faults were cleared is kept.
[[nodiscard]] bool generate_all(const ControllerParams& params, ControllerState& state, StepCommand& out);

// Makes the steps of a stop after an overload: all masses stop, and a motor whose stop cannot be stepped either holds.
// validate() admits no motion that comes here; this is the second line of defence.
void stop_overloaded(const ControllerParams& params, ControllerState& state, StepCommand& out);

// Takes over the counts of a command that is on its way.
void count(const StepCommand& steps, ControllerState& state);

}  // namespace ballast::firmware
