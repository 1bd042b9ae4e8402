// The readings of the robot's sensors. Types only.
#pragma once

#include <limits>

#include "firmware/model/types.h"

namespace ballast::firmware {

// Tick of a message that never arrived: older than any limit.
inline constexpr std::int64_t kNeverTick = std::numeric_limits<std::int64_t>::min();

// Sample of the sensors, body frame, as the robot measures it. A sample from the future counts as stale.
struct Sensors {
  std::int64_t tick = kNeverTick;      // of the sample
  bool attitude_valid = true;          // false: nothing senses the attitude
  Quaternion orientation{1, 0, 0, 0};  // body -> space; not read where the attitude is not valid
  Vector3 gyro_B_radps = Vector3::Zero();
  Vector3 accelerometer_B_mps2 = Vector3::Zero();  // specific force where the accelerometer is
  PerMass<std::uint8_t> limit_switch{};            // bit 0 lower end, bit 1 upper end
  std::int64_t imu_count = 0;                      // samples of gyro and accelerometer so far
  std::int64_t imu_tick = 0;                       // of the newest
  bool has_encoders = false;
  PerMass<Wide> encoder{};     // rail coordinates, rad or m
  std::int64_t fix_count = 0;  // places from outside so far
  std::int64_t fix_tick = 0;   // of the newest
  std::array<Wide, 2> fix_W_m{};
};

}  // namespace ballast::firmware
