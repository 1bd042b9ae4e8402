// Stops of all masses.
#pragma once

#include "firmware/control/params.h"
#include "firmware/control/state.h"

namespace ballast::firmware {

// Plans a stop of all masses from the start of `next` on, in the time that the slowest of them needs, and puts it into
// force. A mass that would leave its rail by being stretched takes its own shortest time.
void begin_stop(const ControllerParams& params, ControllerState& state, std::int64_t next);

}  // namespace ballast::firmware
