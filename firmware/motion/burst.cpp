#include "firmware/motion/burst.h"

#include <algorithm>
#include <cmath>

namespace ballast::firmware {

namespace {

// Covers the error of the crossings' times and rounding in a profile exactly at the motor's rate.
constexpr Wide kNoiseTicks = 0.01;

// Rounds up by conversion, because ceil() is a call on processors without the instruction.
std::int32_t up(Wide ticks) {
  const auto whole = static_cast<std::int32_t>(ticks);
  return static_cast<Wide>(whole) < ticks ? whole + 1 : whole;
}

std::int32_t up_to_int32(Wide ticks) { return up(std::min(ticks, 1e9)); }

// The two integers about a / b, the nearest first; b > 0.
struct Rounded {
  std::int64_t nearest, other;
};
Rounded divide(std::int64_t a, std::int64_t b) {
  // 32 bits, which the processor divides, nearly always suffice. 64 take a function of a hundred instructions.
  const auto short_a = static_cast<std::int32_t>(a), short_b = static_cast<std::int32_t>(b);
  std::int64_t q = 0, r = 0;
  if (short_a == a && short_b == b) {
    q = short_a / short_b;
    r = short_a % short_b;
  } else {
    q = a / b;
    r = a % b;
  }
  if (r < 0) {
    r += b;
    --q;
  }
  return 2 * r > b ? Rounded{q + 1, q} : Rounded{q, q + 1};
}

// Finds `first` for a given interval and add: it lies in the intersection of all windows moved back to pulse 0.
bool verify(std::span<const PulseWindow> pulses, std::int32_t gap, std::int32_t earliest, std::int64_t interval,
            std::int64_t add, StepBurst& burst) {
  const std::size_t size = pulses.size();
  if (interval < gap || interval + add * (static_cast<std::int64_t>(size) - 2) < gap) return false;
  std::int64_t low = std::max(pulses[0].low, earliest), high = pulses[0].high, offset = 0, step = interval;
  for (std::size_t j = 1; j < size; ++j) {
    offset += step;
    step += add;
    low = std::max(low, pulses[j].low - offset);
    high = std::min(high, pulses[j].high - offset);
    if (low > high) return false;
  }
  burst.count = static_cast<std::int16_t>(size);
  burst.first_ticks = static_cast<std::int32_t>(std::clamp<std::int64_t>(pulses[0].nearest(), low, high));
  burst.interval_ticks = static_cast<std::int32_t>(interval);
  burst.add_ticks = static_cast<std::int32_t>(add);
  return true;
}

// Tries the parabola through the first, middle and last pulse, with both roundings of its two integers.
bool fit(std::span<const PulseWindow> pulses, std::int32_t gap, std::int32_t earliest, StepBurst& burst) {
  const auto m = static_cast<std::int64_t>(pulses.size()) - 1;
  const std::int64_t h = m / 2;
  const std::int64_t first = pulses[0].nearest();
  const std::int64_t to_last = std::int64_t{pulses[static_cast<std::size_t>(m)].nearest()} - first;
  Rounded add{0, 0};  // two pulses have no second difference
  if (m >= 2) {
    const std::int64_t to_middle = std::int64_t{pulses[static_cast<std::size_t>(h)].nearest()} - first;
    add = divide(2 * (to_last * h - to_middle * m), m * h * (m - h));
  }
  for (const std::int64_t a : {add.nearest, add.other}) {
    const Rounded interval = divide(to_last - a * (m * (m - 1) / 2), m);
    if (verify(pulses, gap, earliest, interval.nearest, a, burst)) return true;
    if (verify(pulses, gap, earliest, interval.other, a, burst)) return true;
    if (m == 1) break;
  }
  return false;
}

}  // namespace

std::int32_t last_timer_tick(const StepTiming& timing) {
  const Wide ticks = timing.control_period_s * timing.timer_frequency_hz;
  const auto whole = static_cast<std::int32_t>(ticks + 0.5);  // NOLINT(bugprone-incorrect-roundings): it is positive
  // If the period is a whole number of timer ticks, up to rounding, the last one belongs to the next control tick.
  if (std::fabs(ticks - whole) <= 1e-6) return whole - 1;
  return static_cast<std::int32_t>(ticks);
}

PulseRules::PulseRules(const StepTiming& timing, Wide max_step_rate_hz)
    : period_ticks(timing.control_period_s * timing.timer_frequency_hz),
      last_tick(last_timer_tick(timing)),
      tolerance_ticks(std::max(1.0, 0.5e-6 * timing.timer_frequency_hz)),
      spacing_ticks(timing.timer_frequency_hz / max_step_rate_hz),
      // Decimal times make whole numbers of ticks; the product is rounded.
      setup_ticks(std::max(timing.direction_setup_s * timing.timer_frequency_hz - 1e-6, 0.0)),
      // Rounding to timer ticks may bring two pulses one tick closer, and the set-up time holds in full.
      touch_ticks(std::max(std::max(tolerance_ticks, spacing_ticks - kNoiseTicks), setup_ticks + 1 + kNoiseTicks)),
      gap(std::max(std::int32_t{1}, up_to_int32(spacing_ticks - 1 - kNoiseTicks))),
      turn_gap(std::max(gap, up_to_int32(setup_ticks))) {
  // A period that is a whole number of ticks up to rounding becomes exactly that.
  if (static_cast<Wide>(last_tick) + 1 - period_ticks <= 1e-6) period_ticks = static_cast<Wide>(last_tick) + 1;
}

std::int32_t PulseRules::earliest_after(Wide ago_ticks, bool turns) const {
  const Wide due = turns ? std::fmax(spacing_ticks - 1 - kNoiseTicks, setup_ticks) - ago_ticks
                         : spacing_ticks - 1 - kNoiseTicks - ago_ticks;
  return due > 0 ? up_to_int32(due) : 0;
}

// If the crossings keep the distances, the pulses can: the last timer tick not after each crossing is always a valid
// choice, and every bound set here leaves it open. Where a pulse may soon follow in the next control tick, the last
// pulse is placed no later than its crossing.
bool make_windows(std::span<PulseWindow> pulses, const PulseRules& rules, std::int32_t earliest) {
  const Wide tolerance = rules.tolerance_ticks, last = rules.last_tick;
  const std::int32_t gap = rules.gap, turn_gap = rules.turn_gap;
  const auto gaps = static_cast<std::int64_t>(pulses.size()) - 1;
  if (earliest + gaps * gap > rules.last_tick) return false;  // keeps the sums below in range
  std::int32_t least = earliest, direction = pulses[0].direction;
  for (PulseWindow& p : pulses) {
    p.gap = p.direction == direction ? gap : turn_gap;
    direction = p.direction;
    if (&p != pulses.data()) least += p.gap;
    const Wide early = p.exact_ticks - tolerance;
    if (early > 0) least = std::max(least, up(early));
    p.low = least;
    p.high = static_cast<std::int32_t>(std::min(p.exact_ticks + tolerance, last));
  }
  PulseWindow& end = pulses.back();
  if (end.exact_ticks + tolerance + std::max(rules.spacing_ticks, rules.touch_ticks) >= rules.period_ticks) {
    end.high = std::min(end.high, static_cast<std::int32_t>(end.exact_ticks));
  }
  std::int32_t most = end.high;
  for (std::size_t j = pulses.size(); j-- > 0;) {
    PulseWindow& p = pulses[j];
    most = std::min(most, p.high);
    p.high = most;
    if (p.low > most) return false;
    most -= p.gap;
  }
  return true;
}

void raise_lows(std::span<PulseWindow> pulses, std::int32_t earliest) {
  std::int32_t least = earliest;
  for (std::size_t j = 0; j < pulses.size() && pulses[j].low < least; ++j) {
    pulses[j].low = least;
    if (j + 1 < pulses.size()) least += pulses[j + 1].gap;
  }
}

StepBurst longest_burst(std::span<const PulseWindow> pulses, const PulseRules& rules, std::int32_t earliest) {
  std::size_t same = 1;
  while (same < pulses.size() && pulses[same].direction == pulses[0].direction) ++same;

  StepBurst burst;
  burst.direction = static_cast<std::int8_t>(pulses[0].direction);
  burst.count = 1;
  burst.first_ticks = std::max(pulses[0].nearest(), earliest);
  // Bisection on the length. Longer runs mostly fit worse; an exception costs a burst, never a pulse.
  std::size_t fits = 1, too_long = same + 1, length = same;
  while (too_long - fits > 1) {
    if (fit(pulses.first(length), rules.gap, earliest, burst)) {
      fits = length;
    } else {
      too_long = length;
    }
    length = (fits + too_long) / 2;
  }
  return burst;
}

}  // namespace ballast::firmware
