// From a profile to step pulses: a step happens when the profile crosses the middle between two microstep positions.
#pragma once

#include "firmware/motion/profile.h"
#include "firmware/motion/step_command.h"

namespace ballast::firmware {

// Appends to `out` the pulses of `motor` for profile time t0 <= t < t0 + control_period. t0 may be negative; the motor
// stands before 0. Step n+1 (n -> n+1) is where (p(t) - p_zero) * steps_per_unit crosses n + 1/2 upward, n -> n-1 where
// it crosses n - 1/2 downward. Bursts reproduce every crossing to 1 timer tick or 0.5 us, whichever is larger.
//
// The caller sets `tick` and `motor_count` of `out`, and the motor's `position_steps` and `last_pulse` at t0. This
// function brings the latter two up to date. On error it changes nothing in `out` but `bursts` beyond `burst_count`,
// and `trouble`, if given, says why.
//
// The count after a tick is the integer nearest to (p - p_zero) * steps_per_unit at its end; half-way between two, the
// one the profile comes from. A crossing on a border between ticks therefore belongs to the later tick, and a profile
// that only touches a half-way level makes no step.
//
// Pulses of a motor keep their distances across borders between ticks too: at least 1 / max_step_rate, less one timer
// tick of rounding; between opposite pulses at least direction_setup_s, in full. A reversal that crosses a level and
// comes back sooner than that (or than the tolerance above) counts as a touch and makes no step. The generator looks
// ahead along the profile to find a touch with a border inside it. The count is then not the nearest for that short
// time. If the profile is replaced meanwhile, the step comes in the first tick of the new one.
[[nodiscard]] StepError generate_steps(const Profile& profile, Wide t0_s, Wide position_zero, Wide steps_per_unit,
                                       Wide max_step_rate_hz, const StepTiming& timing, int motor, StepCommand& out,
                                       StepTrouble* trouble = nullptr);

}  // namespace ballast::firmware
