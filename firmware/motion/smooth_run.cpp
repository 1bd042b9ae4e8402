#include "firmware/motion/smooth_run.h"

#include <algorithm>
#include <cmath>

namespace ballast::firmware {

namespace {

// A value that fits an int32 rounded to nearest, by conversion: round() is a call on processors without the
// instruction.
std::int32_t nearest(Wide x) { return static_cast<std::int32_t>(x + std::copysign(0.5, x)); }

std::int32_t down(Wide x) {
  const auto whole = static_cast<std::int32_t>(x);
  return static_cast<Wide>(whole) > x ? whole - 1 : whole;
}

class Prover {
 public:
  Prover(const SmoothRun& run, const PulseRules& rules, Wide timer_frequency_hz)
      : run_(run), rules_(rules), frequency_hz_(timer_frequency_hz), tolerance_s_(1e-3 / timer_frequency_hz) {
    const StepCubic& c = run.cubic;
    const Wide v0 = std::fabs(c.velocity_at(run.begin_s)), v1 = std::fabs(c.velocity_at(run.end_s));
    const Wide a = std::max(std::fabs(c.acceleration_at(run.begin_s)), std::fabs(c.acceleration_at(run.end_s)));
    const Wide slowest = std::min(v0, v1), fastest = std::max(v0, v1);
    bend_ = 5 * a;  // see Pulses::follow
    const Wide inverse = 1 / slowest;
    const Wide square = inverse * inverse;
    third_ticks_ = (3 * a * a + fastest * std::fabs(c.jerk)) * square * square * inverse * timer_frequency_hz;
    mean_interval_s_ = 2 / (v0 + v1);
  }

  // Crossings 0, h and m of the pulses from `begin` on. A half of what was looked at before ends at its middle.
  void nodes(int begin, int m) {
    const int h = m / 2;
    const bool half = begin == at_ && m == middle_at_;
    if (begin != at_) {
      at_ = begin;
      first_ = crossing(begin, 0);
    }
    last_ = half ? middle_ : (m == 0 ? first_ : crossing(begin + m, m));
    middle_ = h == 0 ? first_ : crossing(begin + h, h);
    middle_at_ = h;
  }

  // The burst of m + 1 pulses from `begin` on; the first not before `earliest`.
  bool fits(int begin, int m, std::int32_t earliest, StepBurst& burst) {
    const int half = m / 2;
    const Wide n = m, h = half;
    const Wide bent = n * n * n / 60 * third_ticks_;
    const Wide allowed = rules_.tolerance_ticks - bent - 0.01;  // and the crossings' own error
    if (!(allowed > 0)) return false;
    nodes(begin, m);
    // q(n) = first + slope n + curve n (n - 1) / 2
    Wide curve = 0, slope = 0;
    if (m >= 2) curve = 2 * ((last_ - first_) * h - (middle_ - first_) * n) / (n * h * (n - h));
    if (m >= 1) slope = (last_ - first_) / n - curve * (n - 1) / 2;
    if (!(std::fabs(curve) < 1e6) || !(slope < 1e9)) return false;

    const std::int32_t add = nearest(curve);
    const Wide off = static_cast<Wide>(add) - curve;  // per n (n - 1) / 2
    const std::int32_t interval = m >= 1 ? nearest(slope - off * (n - 1) / 2) : 0;
    if (m >= 1 && (interval < rules_.gap || interval + std::int64_t{add} * (m - 1) < rules_.gap)) return false;
    // Distance from q, less that of the first pulse: d(n) = tilt n + off n (n - 1) / 2. Extremes over [0, m].
    const Wide tilt = static_cast<Wide>(interval) - slope;
    const Wide at_end = n * (tilt + off * (n - 1) / 2);
    Wide least = std::min(0.0, at_end), most = std::max(0.0, at_end);
    const Wide vertex = 0.5 - tilt / off;  // NaN and infinity: no vertex inside
    if (vertex > 0 && vertex < n) {
      const Wide there = vertex * (tilt + off * (vertex - 1) / 2);
      least = std::min(least, there);
      most = std::max(most, there);
    }
    // The first pulse may be moved by d0 from its crossing, with -allowed - least <= d0 <= allowed - most.
    const Wide low = first_ - allowed - least, high = first_ + allowed - most;
    std::int32_t first = nearest(first_ - (least + most) / 2);
    if (first < earliest) first = earliest;
    const std::int64_t span = std::int64_t{interval} * m + std::int64_t{add} * m * (m - 1) / 2;
    std::int64_t latest = rules_.last_tick;
    if (last_ + rules_.tolerance_ticks + std::max(rules_.spacing_ticks, rules_.touch_ticks) >= rules_.period_ticks) {
      latest = std::min<std::int64_t>(latest, down(last_));  // a pulse may soon follow in the next control tick
    }
    if (first + span > latest) first = static_cast<std::int32_t>(std::max<std::int64_t>(latest - span, -1));
    if (first < earliest || static_cast<Wide>(first) < low || static_cast<Wide>(first) > high) return false;
    burst.direction = static_cast<std::int8_t>(run_.direction);
    burst.count = static_cast<std::int16_t>(m + 1);
    burst.first_ticks = first;
    burst.interval_ticks = interval;
    burst.add_ticks = m >= 2 ? add : 0;
    end_ticks_ = static_cast<std::int32_t>(first + span);
    return true;
  }

  [[nodiscard]] std::int32_t end_ticks() const { return end_ticks_; }

 private:
  // Of level `index`, in timer ticks; `ahead` > 0: that many levels after crossing first_.
  [[nodiscard]] Wide crossing(int index, int ahead) const {
    const Wide level = run_.first_level + static_cast<Wide>(run_.direction * index);
    Wide w = ahead == 0 ? run_.begin_s + mean_interval_s_ * static_cast<Wide>(index)
                        : first_ / frequency_hz_ - run_.start_s + mean_interval_s_ * ahead;
    if (!(w < run_.end_s)) w = run_.end_s;
    Wide velocity = 0;
    if (!crossing_near(run_.cubic, level, bend_, tolerance_s_, w, velocity) ||
        !(w >= run_.begin_s && w <= run_.end_s)) {
      w = crossing_time(run_.cubic, level, run_.begin_s, run_.end_s, tolerance_s_);
    }
    return (run_.start_s + w) * frequency_hz_;
  }

  const SmoothRun& run_;
  const PulseRules& rules_;
  Wide frequency_hz_;
  Wide tolerance_s_;  // of a crossing's time
  Wide bend_ = 0;
  Wide third_ticks_ = 0;  // bound of |t'''|
  Wide mean_interval_s_ = 0;
  int at_ = -1;         // the pulse first_ is of
  int middle_at_ = -1;  // how many pulses later middle_ is
  Wide first_ = 0, middle_ = 0, last_ = 0;
  std::int32_t end_ticks_ = 0;
};

}  // namespace

int smooth_bursts(const SmoothRun& run, const PulseRules& rules, Wide timer_frequency_hz, StepBurst* bursts, int room) {
  Prover prover(run, rules, timer_frequency_hz);
  int count = 0, hopeless = room > 0 ? run.steps : 0;  // more pulses than that are not to be expected to fit
  std::int32_t earliest = run.earliest;
  for (int done = 0; done < run.steps;) {
    if (run.steps - done > hopeless) return kNoRoom;
    // A burst of one always fits, unless the distances say otherwise.
    int m = run.steps - done - 1;
    while (!prover.fits(done, m, earliest, bursts[count])) {
      if (m == 0) return kNotProved;
      m /= 2;
    }
    ++count;
    done += m + 1;
    hopeless = kHopeless * (m + 1) * (room - count);
    earliest = prover.end_ticks() + rules.gap;
  }
  return count;
}

int sparing_smooth_bursts(const SmoothRun& run, const PulseRules& rules, Wide timer_frequency_hz, StepBurst* bursts,
                          int room) {
  Prover prover(run, rules, timer_frequency_hz);
  int count = 0, guess = run.steps;
  std::int32_t earliest = run.earliest;
  for (int done = 0; done < run.steps; ++count) {
    if (count == room) return kNoRoom;
    // From twice the length of the burst before: halved until it fits, or doubled until it does not; then between.
    const int left = run.steps - done;
    int fits = 0, too_long = left + 1;
    StepBurst burst;
    for (int tried = std::min(left, guess); too_long - fits > 1;) {
      if (prover.fits(done, tried - 1, earliest, burst)) {
        fits = tried;
        bursts[count] = burst;
        tried = too_long > left ? std::min(left, 2 * tried) : (fits + too_long) / 2;
      } else {
        if (tried == 1) return kNotProved;
        too_long = tried;
        tried = (fits + too_long) / 2;
      }
    }
    done += fits;
    guess = 2 * fits;
    const StepBurst& b = bursts[count];
    const int m = b.count - 1;
    earliest = b.first_ticks + m * b.interval_ticks + b.add_ticks * (m * (m - 1) / 2) + rules.gap;
  }
  return count;
}

int coarse_smooth_bursts(const SmoothRun& run, const PulseRules& rules, Wide timer_frequency_hz, StepBurst* bursts,
                         int room) {
  const auto crossing_ticks = [&](int index) {
    const Wide level = run.first_level + static_cast<Wide>(run.direction * index);
    const Wide w = crossing_time(run.cubic, level, run.begin_s, run.end_s, 1e-3 / timer_frequency_hz);
    return (run.start_s + w) * timer_frequency_hz;
  };
  // Of the last pulse: not later than its tolerance allows, on which the distances of the next control tick rest, and
  // not than its crossing where one may soon follow there.
  const Wide end = crossing_ticks(run.steps - 1);
  const bool soon =
      end + rules.tolerance_ticks + std::max(rules.spacing_ticks, rules.touch_ticks) >= rules.period_ticks;
  const std::int64_t latest_end =
      std::min<std::int64_t>(rules.last_tick, down(soon ? end : end + rules.tolerance_ticks));
  if (room < 1 || run.earliest + std::int64_t{run.steps - 1} * rules.gap > latest_end) return kNotProved;
  int count = 0;
  std::int64_t earliest = run.earliest;
  for (int done = 0; done < run.steps; ++count) {
    // From here on `earliest` and `latest` leave room for these pulses, and for those after them.
    const int size = (run.steps - done + room - count - 1) / (room - count), m = size - 1;
    const Wide first = crossing_ticks(done), last = m > 0 ? crossing_ticks(done + m) : first;
    done += size;
    const std::int64_t latest = latest_end - std::int64_t{run.steps - done} * rules.gap;
    const std::int64_t interval =
        m > 0 ? std::clamp<std::int64_t>(nearest((last - first) / m), rules.gap, (latest - earliest) / m) : 0;
    const std::int64_t span = interval * m;
    // Off by as much at its end as at its beginning.
    const std::int64_t middle = nearest((first + last - static_cast<Wide>(span)) / 2);
    StepBurst& burst = bursts[count];
    burst.direction = static_cast<std::int8_t>(run.direction);
    burst.count = static_cast<std::int16_t>(size);
    burst.first_ticks = static_cast<std::int32_t>(std::clamp(middle, earliest, latest - span));
    burst.interval_ticks = static_cast<std::int32_t>(interval);
    burst.add_ticks = 0;
    earliest = burst.first_ticks + span + rules.gap;
  }
  return count;
}

}  // namespace ballast::firmware
