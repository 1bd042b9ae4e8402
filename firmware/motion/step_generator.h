// From a profile to step pulses: a step happens when the profile crosses the middle between two microstep positions.
#pragma once

#include "firmware/motion/profile.h"

namespace ballast::firmware {

inline constexpr int kMaxBursts = 32;        // in one command, all motors together
inline constexpr int kMaxStepsPerTick = 64;  // per motor

// `count` pulses; pulse j = 0..count-1 comes first + j interval + add j (j-1) / 2 timer ticks after the control tick's
// start.
struct StepBurst {
  std::uint8_t motor = 0;
  std::int8_t direction = 1;  // +1 or -1
  std::int16_t count = 0;
  std::int32_t first_ticks = 0;
  std::int32_t interval_ticks = 0;
  std::int32_t add_ticks = 0;
};

// All pulses of one control tick, per motor in time order.
struct StepCommand {
  std::int64_t tick = 0;  // the control tick in which they are executed
  int motor_count = 0;
  PerMass<std::int32_t> steps{};           // signed sum of this command's pulses
  PerMass<std::int64_t> position_steps{};  // signed sum since the start
  int burst_count = 0;
  std::array<StepBurst, kMaxBursts> bursts{};
};

struct StepTiming {
  Real timer_frequency_hz = 0;  // of the step timer
  Real control_period_s = 0;
};

enum class StepError : std::uint8_t {
  kNone,
  kTooManySteps,   // more than kMaxStepsPerTick of one motor in one tick
  kTooManyBursts,  // more than kMaxBursts
  kTooFast,        // two pulses of one motor in the same timer tick, or above the motor's step rate
};

// Appends to `out` the pulses of `motor` for profile time t0 <= t < t0 + control_period (t0 may be negative: nothing
// before 0). Step n+1 (n -> n+1) is where (p(t) - p_zero) * steps_per_unit crosses n + 1/2 upward, n -> n-1 where it
// crosses n - 1/2 downward; reversals inside the tick are right. Bursts reproduce every crossing to 1 timer tick or 0.5
// us, whichever is larger. `position_steps` in `out` must hold the motor's count at t0 and is brought up to date. On
// error `out` is untouched.
//
// The count after a tick is the integer nearest to (p - p_zero) * steps_per_unit at its end; half-way between two, the
// one the profile comes from. So a crossing on a border between ticks belongs to the later one, and a profile that only
// touches a half-way level makes no step. A reversal that crosses a level and comes back within one tick sooner than
// the motor's step rate (or the tolerance above) allows counts as a touch. Rates are checked inside a tick: between
// pulses, and at each crossing by the profile's velocity there. `motor_count` and `tick` of `out` are the caller's.
[[nodiscard]] StepError generate_steps(const Profile& profile, Real t0_s, Real position_zero, Real steps_per_unit,
                                       Real max_step_rate_hz, const StepTiming& timing, int motor, StepCommand& out);

}  // namespace ballast::firmware
