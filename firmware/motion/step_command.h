// Step pulses of one control tick as integers, and the errors of making them. Types only.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "firmware/model/types.h"

namespace ballast::firmware {

inline constexpr int kMaxBursts = 32;        // in one command, all motors together
inline constexpr int kMaxStepsPerTick = 64;  // per motor

// Bursts that each of `motors` motors may use in one command: its equal share.
[[nodiscard]] constexpr int bursts_per_motor(int motors) { return kMaxBursts / std::max(motors, 1); }

// Pulses per control tick that a motor's share of the bursts surely carries, with one turn per tick. validate() derives
// the greatest step rate from it. Any three pulses in one direction fit one burst, and a turn costs at most one burst
// more. Proof: firmware/README.md.
[[nodiscard]] constexpr int sure_steps_per_tick(int motors) {
  return std::min(kMaxStepsPerTick, 3 * bursts_per_motor(motors) - 2);
}

// `count` pulses at the times of pulse_ticks().
struct StepBurst {
  std::uint8_t motor = 0;
  std::int8_t direction = 1;  // +1 or -1
  std::int16_t count = 0;
  std::int32_t first_ticks = 0;
  std::int32_t interval_ticks = 0;
  std::int32_t add_ticks = 0;
};

// Timer ticks from the control tick's start to pulse j = 0..count-1 of a burst. They have 64 bits, because a burst from
// outside may hold any numbers.
[[nodiscard]] constexpr std::int64_t pulse_ticks(const StepBurst& burst, std::int64_t j) {
  return burst.first_ticks + j * burst.interval_ticks + j * (j - 1) / 2 * burst.add_ticks;
}

// The newest pulse of a motor, from which pulses of the next control tick keep their distance.
struct LastPulse {
  std::int64_t tick = 0;         // control tick
  std::int32_t timer_ticks = 0;  // from its start
  std::int8_t direction = 0;     // 0: no pulse yet
};

// All pulses of one control tick, per motor in time order.
struct StepCommand {
  std::int64_t tick = 0;  // the control tick in which they are executed
  int motor_count = 0;
  PerMass<std::int32_t> steps{};           // signed sum of this command's pulses
  PerMass<std::int64_t> position_steps{};  // signed sum since the start
  PerMass<LastPulse> last_pulse{};
  int burst_count = 0;
  std::array<StepBurst, kMaxBursts> bursts{};
};

struct StepTiming {
  Wide timer_frequency_hz = 0;  // of the step timer
  Wide control_period_s = 0;
  Wide direction_setup_s = 0;   // least time between two opposite pulses of a motor: its driver's set-up and hold
  int max_bursts = kMaxBursts;  // of one motor in one command: its share
};

enum class StepError : std::uint8_t {
  kNone = 0,
  kTooManySteps = 1,   // more than kMaxStepsPerTick of one motor in one tick
  kTooManyBursts = 2,  // more than the motor's share of the bursts
  kTooFast = 3,        // above the motor's step rate, or pulses that cannot keep their distances
};

// Quantity that could not be stepped, and its limit.
struct StepTrouble {
  StepError error = StepError::kNone;
  Wide value = 0;  // kTooManySteps: steps in the tick, as far as they were counted; kTooManyBursts: bursts; kTooFast:
                   // steps/s
  Wide limit = 0;
};

}  // namespace ballast::firmware
