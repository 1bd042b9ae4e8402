#include "firmware/motion/burst.h"

#include <algorithm>
#include <cmath>

namespace ballast::firmware {

namespace {

std::int64_t floor_div(std::int64_t a, std::int64_t b) {  // b > 0
  const std::int64_t q = a / b;
  return q * b > a ? q - 1 : q;
}

// With interval and add chosen, `first` has to lie in the intersection of the windows moved back to pulse 0.
bool verify(std::span<const PulseWindow> pulses, std::int64_t interval, std::int64_t add, StepBurst& burst) {
  const auto gaps = static_cast<std::int64_t>(pulses.size()) - 1;
  if (interval < 1 || interval + add * (gaps - 1) < 1) return false;
  std::int64_t low = pulses[0].low, high = pulses[0].high, offset = 0;
  for (std::int64_t j = 1; j <= gaps; ++j) {
    offset += interval + add * (j - 1);
    low = std::max(low, pulses[static_cast<std::size_t>(j)].low - offset);
    high = std::min(high, pulses[static_cast<std::size_t>(j)].high - offset);
  }
  if (low > high) return false;
  burst.count = static_cast<std::int16_t>(pulses.size());
  burst.first_ticks = static_cast<std::int32_t>(std::clamp<std::int64_t>(pulses[0].nearest, low, high));
  burst.interval_ticks = static_cast<std::int32_t>(interval);
  burst.add_ticks = static_cast<std::int32_t>(add);
  return true;
}

// Parabola through the first, middle and last pulse, with both roundings of its two integers.
bool fit(std::span<const PulseWindow> pulses, StepBurst& burst) {
  const auto m = static_cast<std::int64_t>(pulses.size()) - 1;
  const std::int64_t h = m / 2;
  const std::int64_t to_last = std::int64_t{pulses[static_cast<std::size_t>(m)].nearest} - pulses[0].nearest;
  std::int64_t add = 0;
  if (m >= 2) {
    const std::int64_t to_middle = std::int64_t{pulses[static_cast<std::size_t>(h)].nearest} - pulses[0].nearest;
    add = floor_div(2 * (to_last * h - to_middle * m), m * h * (m - h));
  }
  for (const std::int64_t a : {add, add + 1}) {
    const std::int64_t interval = floor_div(to_last - a * (m * (m - 1) / 2), m);
    for (const std::int64_t i : {interval, interval + 1}) {
      if (verify(pulses, i, a, burst)) return true;
    }
    if (m == 1) break;  // two pulses have no second difference
  }
  return false;
}

}  // namespace

std::int32_t last_timer_tick(const StepTiming& timing) {
  const Real ticks = timing.control_period_s * timing.timer_frequency_hz;
  const Real whole = std::round(ticks);
  // A whole number of timer ticks, but for the rounding of the product: the last one belongs to the next control tick.
  if (std::fabs(ticks - whole) <= 1e-6) return static_cast<std::int32_t>(whole) - 1;
  return static_cast<std::int32_t>(std::floor(ticks));
}

bool make_windows(std::span<PulseWindow> pulses, const StepTiming& timing) {
  const Real tolerance = std::fmax(1.0, 0.5e-6 * timing.timer_frequency_hz);
  const Real last = last_timer_tick(timing);
  for (PulseWindow& p : pulses) {
    const Real nearest = std::fmin(std::fmax(std::round(p.exact_ticks), 0.0), last);
    p.nearest = static_cast<std::int32_t>(nearest);
    // The nearest tick is always allowed; the clamp at the tick's end costs it at most one timer tick.
    p.low = static_cast<std::int32_t>(std::fmin(nearest, std::fmax(std::ceil(p.exact_ticks - tolerance), 0.0)));
    p.high = static_cast<std::int32_t>(std::fmax(nearest, std::fmin(std::floor(p.exact_ticks + tolerance), last)));
  }
  for (std::size_t j = 1; j < pulses.size(); ++j) {
    PulseWindow& before = pulses[j - 1];
    PulseWindow& after = pulses[j];
    if (after.nearest <= before.nearest) return false;
    before.high = std::min(before.high, before.nearest + (after.nearest - before.nearest - 1) / 2);
    after.low = std::max(after.low, before.high + 1);
  }
  return true;
}

StepBurst longest_burst(std::span<const PulseWindow> pulses) {
  std::size_t same = 1;
  while (same < pulses.size() && pulses[same].direction == pulses[0].direction) ++same;

  StepBurst burst;
  burst.direction = pulses[0].direction;
  burst.count = 1;
  burst.first_ticks = pulses[0].nearest;
  // Bisection on the length; that longer runs fit worse is not quite monotone, which costs a burst, never a pulse.
  std::size_t fits = 1, too_long = same + 1, length = same;
  while (too_long - fits > 1) {
    if (fit(pulses.first(length), burst)) {
      fits = length;
    } else {
      too_long = length;
    }
    length = (fits + too_long) / 2;
  }
  return burst;
}

}  // namespace ballast::firmware
