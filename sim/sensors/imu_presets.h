// IMUs one can buy: the values of `preset` in a scenario's [sensors].
#pragma once

#include <span>
#include <string_view>

#include "sim/sensors/sensor_model.h"

namespace ballast::sim {

struct ImuPreset {
  std::string_view name;
  std::string_view source;
  ImuTriad gyro;
  ImuTriad accelerometer;
};

// Each part as it comes, and the same part "_calibrated": its offsets, scales and axes measured in six positions and on
// a turntable, with what usually remains. Datasheets print no bias walk; it is an assumption of the usual order.
std::span<const ImuPreset> imu_presets();

}  // namespace ballast::sim
