// Modes of the controller. A type only.
#pragma once

#include <cstdint>

namespace ballast::firmware {

// The numbers are those of controller_status_t.
enum class Mode : std::uint8_t {
  kDisarmed = 0,  // motors hold, nothing moves, commands other than arm are ignored
  kArmed = 1,     // checks passed, waiting for start
  kRunning = 2,   // the masses follow their profiles, or a course
  kStopping = 3,  // decelerating at the operator's command
  kTripped = 4,   // decelerating, then holding, because of a fault; left only by reset, at rest, with the cause gone
  kMoving = 5,    // the masses go where the operator has asked them to
  kPending = 6,   // a move is planned and being predicted, or a course is being certified; the masses hold
  kHalting = 7,   // the ball is brought to rest, once a certificate for that is found
};

}  // namespace ballast::firmware
