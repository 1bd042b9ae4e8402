// What a monitor has heard in a tick in which messages may have suffered on their way: of each channel nothing, one, or
// several, of this tick or of others.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "tools/monitor/monitor.h"

namespace ballast::monitor {

struct Heard {
  std::vector<contact_t> contact;
  std::vector<plant_state_t> state;
  std::vector<sensors_t> sensors;
  std::optional<std::int64_t> controller_tick;  // as in Samples
  std::optional<Estimate> estimate;
};

// Of each channel the message of the tick that is due counts, or the newest. What comes twice is judged twice.
trip_t judge(Monitor& monitor, const Heard& heard);

}  // namespace ballast::monitor
