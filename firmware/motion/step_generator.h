// Step pulses from a profile. A step happens where the profile crosses the middle between two microstep positions.
#pragma once

#include "firmware/motion/profile.h"
#include "firmware/motion/step_command.h"

namespace ballast::firmware {

// Appends to `out` the pulses of `motor` for profile time t0 <= t < t0 + control_period. t0 may be negative; the motor
// stands before 0. With x = (p(t) - p_zero) * steps_per_unit, the step n -> n+1 is where x crosses n + 1/2 upward, and
// n -> n-1 where it crosses n - 1/2 downward. Bursts reproduce every crossing to 1 timer tick or 0.5 us, the larger
// one.
//
// The caller sets `tick` and `motor_count` of `out`, and the motor's `position_steps` and `last_pulse` at t0. This
// function brings the latter two up to date. On error it changes nothing in `out` but `bursts` beyond `burst_count`,
// and `trouble`, if given, says why.
//
// The count after a tick is the integer nearest to x at its end. Half-way between two integers it is the one from which
// the profile comes. So a crossing on a border between ticks belongs to the later tick, and a profile that only touches
// a half-way level makes no step.
//
// Pulses of a motor keep their distances across borders between ticks too: at least 1 / max_step_rate, less one timer
// tick of rounding; between opposite pulses at least direction_setup_s, in full. A reversal that crosses a level and
// comes back sooner than that, or than the tolerance above, is a touch and makes no step. The generator follows the
// profile beyond the tick to find a touch across the border. For that short time the count is not the nearest integer.
// If the profile is replaced meanwhile, the step comes in the first tick of the new one.
[[nodiscard]] StepError generate_steps(const Profile& profile, Wide t0_s, Wide position_zero, Wide steps_per_unit,
                                       Wide max_step_rate_hz, const StepTiming& timing, int motor, StepCommand& out,
                                       StepTrouble* trouble = nullptr);

}  // namespace ballast::firmware
