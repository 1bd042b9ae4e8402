// Faults of the world as the firmware observes them. They latch until an operator's reset.
#pragma once

#include <cstdint>

namespace ballast::firmware {

enum class Fault : std::uint32_t {
  kNone = 0,
  // NaN or infinity in the sensors, a quaternion far from unit length, or a number beyond 2^50
  kSensorNotFinite = 1u << 0,
  kSensorStale = 1u << 1,     // no sensors of this tick for more than the stated number of ticks
  kMonitorStale = 1u << 2,    // no heartbeat of the monitor for more than the stated number of ticks
  kMonitorTrip = 1u << 3,     // the monitor has tripped
  kStepOverload = 1u << 4,    // a profile asks for steps that cannot be issued
  kTickOutOfOrder = 1u << 5,  // a control tick was repeated or skipped
  kInternal = 1u << 6,        // a bug of the firmware (assert)
  kEndSwitch = 1u << 7,       // a mass closes the switch at an end of its rail and is commanded on over that end
  kSlipMeasured = 1u << 8,    // the accelerometer shows that the contact slips, while masses are commanded to move
  kLightMeasured = 1u << 9,   // the accelerometer shows that the floor hardly carries the ball, in the same modes
  kNoEstimate = 1u << 10,     // the attitude is to be estimated, and the estimate is not valid or is no number
};

constexpr std::uint32_t bit(Fault fault) { return static_cast<std::uint32_t>(fault); }

}  // namespace ballast::firmware
