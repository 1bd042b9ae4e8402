// One lap of the data flow: every message of one control tick.
#pragma once

#include <optional>
#include <vector>

#include "hal/lcm/messages.h"
#include "tools/sil/plant_messages.h"

namespace ballast::sil {

// The controller's messages of one tick: its status, and the steps of the next tick.
struct Answer {
  controller_status_t status{};
  step_command_t steps{};
};

struct Lap {
  PlantMessages plant;
  std::optional<operator_t> command;  // the run's own, as operator
  std::vector<operator_t> heard;      // of other operators, since the lap before
  std::optional<trip_t> verdict;      // none: the monitor has not spoken in this tick
  std::optional<Answer> answer;       // none: the controller has not spoken in this tick, or there is none

  [[nodiscard]] std::int64_t tick() const { return plant.contact.tick; }
};

}  // namespace ballast::sil
