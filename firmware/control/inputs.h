// Inputs of a control tick. Types only.
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
  Vector3 accelerometer_B_mps2 = Vector3::Zero();  // specific force at the geometric centre
  PerMass<std::uint8_t> limit_switch{};            // bit 0 lower end, bit 1 upper end
  std::int64_t imu_count = 0;                      // samples of gyro and accelerometer so far
  std::int64_t imu_tick = 0;                       // of the newest
  bool has_encoders = false;
  PerMass<Wide> encoder{};     // rail coordinates, rad or m
  std::int64_t fix_count = 0;  // places from outside so far
  std::int64_t fix_tick = 0;   // of the newest
  std::array<Wide, 2> fix_W_m{};
};

// The monitor's heartbeat.
struct MonitorVerdict {
  std::int64_t tick = kNeverTick;  // the tick it is about
  bool tripped = false;
};

enum class OperatorCommand : std::uint8_t { kNone = 0, kArm = 1, kStart = 2, kStop = 3, kReset = 4, kMove = 5 };

// Moves masses from rest to rest, all in the time that the slowest needs. It is judged before anything moves.
struct MoveRequest {
  std::uint32_t masses = 0;         // bit i: mass i moves; the others stay
  PerMass<Wide> target_position{};  // rail coordinate, rad or m; read where the bit is set
  Wide speed_fraction = 1;          // 0 < .. <= 1: the shortest time is divided by it
};

// Command of the operator. A plain command and a move convert.
struct OperatorInput {
  OperatorCommand command = OperatorCommand::kNone;
  MoveRequest move;  // read with kMove only
  OperatorInput() = default;
  // NOLINTBEGIN(google-explicit-constructor)
  OperatorInput(OperatorCommand c) : command(c) {}
  OperatorInput(const MoveRequest& request) : command(OperatorCommand::kMove), move(request) {}
  // NOLINTEND(google-explicit-constructor)
};

// Everything that reaches the controller in one tick. A message that did not arrive keeps its last value and its old
// tick.
struct Inputs {
  std::int64_t tick = 0;
  Sensors sensors;
  MonitorVerdict monitor;
  OperatorInput operator_command;
};

}  // namespace ballast::firmware
