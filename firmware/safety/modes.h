// The supervisor: modes as an ordered transition table held as data. A trip latches.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace ballast::firmware {

// The numbers are those of controller_status_t.
enum class Mode : std::uint8_t {
  kDisarmed = 0,  // motors hold, nothing moves, commands other than arm are ignored
  kArmed = 1,     // checks passed, waiting for start
  kRunning = 2,   // the masses follow their profiles
  kStopping = 3,  // decelerating at the operator's wish
  kTripped = 4,   // decelerating, then holding, because of a fault; left only by reset, at rest, with the cause gone
  kMoving = 5,    // the masses go where the operator has asked them to
  kPending = 6,   // a move is planned and being predicted; the masses hold
};

enum class Event : std::uint8_t {
  kFault,   // any Fault; strongest
  kStop,    // operator
  kStart,   // operator
  kArm,     // operator
  kReset,   // operator
  kMove,    // operator
  kAtRest,  // all commanded velocities are zero and stay so
  kDue,     // the pending move begins with the next tick
};

// What has to hold for a row to fire, beside its mode and event.
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
