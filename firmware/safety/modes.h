// The supervisor: modes as an ordered transition table held as data. A trip latches.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "firmware/safety/mode.h"

namespace ballast::firmware {

enum class Event : std::uint8_t {
  kFault,   // any Fault; strongest
  kStop,    // operator
  kStart,   // operator
  kArm,     // operator
  kReset,   // operator
  kMove,    // operator
  kHalt,    // operator
  kGo,      // a course of the operator has arrived
  kAtRest,  // all commanded velocities are zero and stay so
  kDue,     // the pending move begins with the next tick; the halted ball rests, or cannot be halted
  kCourse,  // the pending course begins with the next tick
};

// Condition of a row, beside its mode and event.
enum class Guard : std::uint8_t {
  kAlways,
  kHealthy,         // sensors valid and fresh, monitor alive and not tripped, no fault
  kAtRestAndClear,  // masses at rest, and no cause of a fault present now
};

struct Transition {
  Mode from;
  Event event;
  Guard guard;
  Mode to;
};

// In order; the first row that matches (mode, event) and whose guard holds fires. No row: the event is ignored.
std::span<const Transition> transition_table();

struct GuardState {
  bool healthy = false;
  bool at_rest = false;
  bool cause_present = false;
};

[[nodiscard]] Mode next_mode(Mode mode, Event event, const GuardState& guards);

}  // namespace ballast::firmware
