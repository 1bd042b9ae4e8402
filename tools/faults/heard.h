// The plant's messages as a monitor hears them in one tick in which messages may be lost, late or repeated: of each
// channel none, one or several, of this tick or of others.
#pragma once

#include <optional>
#include <vector>

#include "tools/monitor/monitor.h"

namespace ballast::sil {

struct Heard {
  std::vector<contact_t> contact;
  std::vector<plant_state_t> state;
  std::vector<sensors_t> sensors;
  std::optional<controller_status_t> status;  // the newest so far
};

// Judges the message of the tick that is due on each channel, or the newest. Messages of one tick that come twice are
// judged twice, which trips the monitor.
trip_t judge(monitor::Monitor& monitor, const Heard& heard);

}  // namespace ballast::sil
