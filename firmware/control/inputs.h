// Inputs of a control tick. Types only.
#pragma once

#include "firmware/control/course.h"
#include "firmware/estimation/sensors.h"

namespace ballast::firmware {

// The monitor's heartbeat.
struct MonitorVerdict {
  std::int64_t tick = kNeverTick;  // the tick it is about
  bool tripped = false;
};

enum class OperatorCommand : std::uint8_t {
  kNone = 0,
  kArm = 1,
  kStart = 2,
  kStop = 3,
  kReset = 4,
  kMove = 5,
  kHalt = 6,
  kGo = 7  // a part of a course; the last part asks for it
};

// Moves masses from rest to rest, all in the time that the slowest needs. It is judged before anything moves.
struct MoveRequest {
  std::uint32_t masses = 0;         // bit i: mass i moves; the others stay
  PerMass<Wide> target_position{};  // rail coordinate, rad or m; read where the bit is set
  Wide speed_fraction = 1;          // 0 < .. <= 1: the shortest time is divided by it
};

// Command of the operator. A plain command and a move convert.
struct OperatorInput {
  OperatorCommand command = OperatorCommand::kNone;
  MoveRequest move;   // read with kMove only
  CoursePart course;  // read with kGo only
  OperatorInput() = default;
  // NOLINTBEGIN(google-explicit-constructor)
  OperatorInput(OperatorCommand c) : command(c) {}
  OperatorInput(const MoveRequest& request) : command(OperatorCommand::kMove), move(request) {}
  OperatorInput(const CoursePart& part) : command(OperatorCommand::kGo), course(part) {}
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
