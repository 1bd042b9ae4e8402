// The order in which modes may follow each other. Written from the controller's page, without the firmware's table: a
// fault trips every controller that is armed, a trip ends by a reset only, and every other change has a command of its
// own.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/lcm/messages.h"

namespace ballast::soak {

// The status of the tick before, this one, and the operator's command that was counted in between.
struct ModeStep {
  const controller_status_t& before;
  const controller_status_t& now;
  std::optional<operator_t> command;
  bool monitor_tripped;  // says the verdict that the controller has
};

enum class ModeError : std::int8_t { kNone, kFaultWithoutTrip, kTripReleased, kNotCommanded, kStopIgnored };

// Judges two successive ticks.
[[nodiscard]] ModeError judge(const ModeStep& step);

const char* to_string(ModeError error);

}  // namespace ballast::soak
