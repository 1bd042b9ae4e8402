// Motion that the masses are commanded to follow.
#pragma once

#include "firmware/control/params.h"
#include "firmware/control/state.h"

namespace ballast::firmware {

// Profile time at the start of a tick.
[[nodiscard]] Wide profile_time(const ControllerParams& params, const ControllerState& state, std::int64_t tick);

// Commanded point of mass i at the start of a tick.
[[nodiscard]] ProfilePoint commanded(const ControllerParams& params, const ControllerState& state, std::int64_t tick,
                                     int i);

// True if all masses are commanded to rest from the start of a tick on.
[[nodiscard]] bool at_rest_from(const ControllerParams& params, const ControllerState& state, std::int64_t tick);

// Puts the profiles in `active` into force from the start of `next` on.
void begin(ControllerState& state, std::int64_t next);

// Makes the masses hold where their profiles are at the start of `tick`.
void hold(const ControllerParams& params, ControllerState& state, std::int64_t tick);

}  // namespace ballast::firmware
