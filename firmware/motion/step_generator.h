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

// The newest pulse of a motor, so that distances are kept across the borders between control ticks.
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
  Wide direction_setup_s = 0;    // least time between two opposite pulses of a motor: its driver's set-up and hold
  bool sparing = false;          // as few bursts as can be found, which takes longer
  bool overloaded = false;       // in a stop after an overload: what no rule leaves room for is coarser or late
  int most_bursts = kMaxBursts;  // of this motor in this command
};

enum class StepError : std::uint8_t {
  kNone = 0,
  kTooManySteps = 1,   // more than kMaxStepsPerTick of one motor in one tick
  kTooManyBursts = 2,  // more than kMaxBursts, or than StepTiming::most_bursts; never with StepTiming::overloaded
  kTooFast = 3,        // above the motor's step rate, or pulses that cannot keep their distances
};

// What could not be stepped, as a number and its limit.
struct StepTrouble {
  StepError error = StepError::kNone;
  Wide value = 0;  // kTooManySteps: steps in the tick, as far as they were counted; kTooManyBursts: bursts in the
                   // command; kTooFast: steps/s
  Wide limit = 0;
};

// Appends to `out` the pulses of `motor` for profile time t0 <= t < t0 + control_period (t0 may be negative: nothing
// before 0). Step n+1 (n -> n+1) is where (p(t) - p_zero) * steps_per_unit crosses n + 1/2 upward, n -> n-1 where it
// crosses n - 1/2 downward; reversals inside the tick are right. Bursts reproduce every crossing to 1 timer tick or 0.5
// us, whichever is larger. `tick`, `motor_count`, and the motor's `position_steps` and `last_pulse` at t0 are the
// caller's; the latter two are brought up to date. On error `out` is untouched, but for `bursts` beyond `burst_count`,
// and `trouble`, if given, says why.
//
// The count after a tick is the integer nearest to (p - p_zero) * steps_per_unit at its end; half-way between two, the
// one the profile comes from. So a crossing on a border between ticks belongs to the later one, and a profile that only
// touches a half-way level makes no step.
//
// Distances between pulses of a motor, across borders between ticks too: at least 1 / max_step_rate, less one timer
// tick of rounding; between opposite pulses at least direction_setup_s, in full. A reversal that crosses a level and
// comes back sooner than that (or than the tolerance above) counts as a touch, also if a border lies between: the
// generator looks ahead along the profile. The count is then not the nearest for that short time. If the profile is
// replaced meanwhile, the step comes as soon as it is seen.
//
// StepTiming::overloaded: distances, the tick and the count at its end are kept as ever. Where most_bursts do not
// suffice, each way of the motor gets its part of them, in equal numbers of pulses, each a straight line from
// crossing to crossing: in the tick, but not within the tolerance. What finds no room in the tick is left to
// the next: pulses that cannot keep their distances, and ways beyond most_bursts.
[[nodiscard]] StepError generate_steps(const Profile& profile, Wide t0_s, Wide position_zero, Wide steps_per_unit,
                                       Wide max_step_rate_hz, const StepTiming& timing, int motor, StepCommand& out,
                                       StepTrouble* trouble = nullptr);

}  // namespace ballast::firmware
