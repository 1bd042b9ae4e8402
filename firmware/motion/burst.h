// From pulse times to integer bursts (first, interval, add, count).
#pragma once

#include <span>

#include "firmware/motion/step_generator.h"

namespace ballast::firmware {

// One pulse: its exact time, and the timer ticks [low, high] in which it may be replayed. Windows of one motor do not
// overlap, so whatever is chosen inside them, pulses stay strictly in order.
struct PulseWindow {
  Real exact_ticks = 0;
  std::int32_t nearest = 0;
  std::int32_t low = 0;
  std::int32_t high = 0;
  std::int8_t direction = 1;
};

// Last timer tick strictly inside a control tick.
std::int32_t last_timer_tick(const StepTiming& timing);

// From exact_ticks and direction (pulses in time order, inside the tick) to the rest: within max(1 timer tick, 0.5 us)
// of exact. False if two pulses fall in the same timer tick.
[[nodiscard]] bool make_windows(std::span<PulseWindow> pulses, const StepTiming& timing);

// The longest burst found for pulses[0..count): same direction, every pulse replayed in integers and found in its
// window. pulses must not be empty. One pulse always fits.
StepBurst longest_burst(std::span<const PulseWindow> pulses);

}  // namespace ballast::firmware
