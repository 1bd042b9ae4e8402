// The robot's own sensors.
#pragma once

#include <concepts>

#include "firmware/control/inputs.h"
#include "hal/status.h"

namespace ballast::hal {

// read_sensors(sensors):
//   kOk: a sample that has not been read before, bit for bit. NaN passes; the firmware judges it.
//   kEmpty: none came. `sensors` keeps the old sample with its old tick.
template <class B>
concept SensorSource = requires(B& board, firmware::Sensors& sensors) {
  { board.read_sensors(sensors) } -> std::same_as<Status>;
};

}  // namespace ballast::hal
