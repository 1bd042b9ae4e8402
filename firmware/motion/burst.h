// Integer bursts (first, interval, add, count) from pulse times.
#pragma once

#include <span>

#include "firmware/motion/step_command.h"

namespace ballast::firmware {

// One pulse: its exact time, and the timer ticks [low, high] in which it may be replayed. Members have no initial
// values, because setting those of a whole tick's array would cost more than its pulses.
struct PulseWindow {
  Wide exact_ticks;
  std::int32_t low;
  std::int32_t high;
  std::int32_t gap;  // distance to be kept to the pulse before
  std::int32_t direction;

  // The timer tick in [low, high] nearest to exact_ticks.
  [[nodiscard]] std::int32_t nearest() const {
    // Positive inside the tick, clamped elsewhere.
    const auto rounded = static_cast<std::int32_t>(exact_ticks + 0.5);  // NOLINT(bugprone-incorrect-roundings)
    return rounded < low ? low : (rounded > high ? high : rounded);
  }
};

// Limits on the pulses of one motor, in timer ticks. Derived from StepTiming and the motor's rate.
struct PulseRules {
  PulseRules(const StepTiming& timing, Wide max_step_rate_hz);

  Wide period_ticks;       // of a control tick; need not be whole
  std::int32_t last_tick;  // the last timer tick inside a control tick
  Wide tolerance_ticks;    // between a pulse and its crossing: 1 timer tick or 0.5 us, whichever is larger
  Wide spacing_ticks;      // between crossings: 1 / max_step_rate
  Wide setup_ticks;        // between opposite pulses
  Wide touch_ticks;        // opposite crossings closer than this are a touch; their pulses would break a rule above
  std::int32_t gap;        // least distance of pulses: the spacing less a timer tick of rounding, and at least 1
  std::int32_t turn_gap;   // of opposite pulses: not less than setup_ticks either

  // The first timer tick of a control tick that keeps the distance to a pulse `ago_ticks` before the tick's start.
  [[nodiscard]] std::int32_t earliest_after(Wide ago_ticks, bool turns) const;
};

// Last timer tick strictly inside a control tick.
std::int32_t last_timer_tick(const StepTiming& timing);

// Sets low, high and gap from exact_ticks and direction. There is at least one pulse; pulses are in time order and
// inside the tick. Any choice in one window leaves the other pulses, and the first one of the next control tick, a
// choice that keeps their distances. `earliest`: the first pulse's bound by a pulse before this control tick. False if
// the distances cannot be kept.
[[nodiscard]] bool make_windows(std::span<PulseWindow> pulses, const PulseRules& rules, std::int32_t earliest = 0);

// Raises windows so that the first pulse is not before `earliest` and the others keep their distances after it. At the
// motor's step rate only the rounding leaves time to catch up, so without this a burst that ends late would be followed
// by single pulses.
void raise_lows(std::span<PulseWindow> pulses, std::int32_t earliest);

// Returns the longest burst found from pulses[0] on, in one direction. Each pulse is replayed in integers and lies in
// its window, at least rules.gap after the one before; the first is not before `earliest`. `pulses` must not be empty.
// One pulse always fits.
StepBurst longest_burst(std::span<const PulseWindow> pulses, const PulseRules& rules, std::int32_t earliest = 0);

}  // namespace ballast::firmware
