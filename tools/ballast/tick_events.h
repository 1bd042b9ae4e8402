// The messages of one tick of a run as events, for the servers that show it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "hal/lcm/messages.h"

namespace ballast {

// At most PIPE_BUF bytes: what does not fit is left out. All events have the plant's time, so that a timeline does not
// jump to the tick that a controller answered. `number` counts them.
std::string tick_events(const contact_t& contact, const plant_state_t& state,
                        const std::optional<controller_status_t>& status, const std::optional<trip_t>& trip,
                        std::int64_t& number);

}  // namespace ballast
