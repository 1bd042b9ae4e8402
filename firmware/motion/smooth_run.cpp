#include "firmware/motion/smooth_run.h"

#include <algorithm>
#include <cmath>

namespace ballast::firmware {

namespace {

// Rounds a value that fits an int32 by conversion, because round() is a call on processors without the instruction.
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
    bend_ = 5 * a;  // as in Pulses::follow
    const Wide inverse = 1 / slowest;
    const Wide square = inverse * inverse;
    third_ticks_ = (3 * a * a + fastest * std::fabs(c.jerk)) * square * square * inverse * timer_frequency_hz;
    mean_interval_s_ = 2 / (v0 + v1);
  }

  // Sets crossings 0, h and m of the pulses from `begin` on. The first half of the previous stretch reuses its middle.
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

  // Makes the burst of m + 1 pulses from `begin` on, the first not before `earliest`. False: it is not proved.
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
  // Time of level `index`, in timer ticks; `ahead` > 0: that many levels after crossing first_.
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

int smooth_bursts(const SmoothRun& run, const PulseRules& rules, Wide timer_frequency_hz, std::span<StepBurst> bursts) {
  Prover prover(run, rules, timer_frequency_hz);
  std::size_t count = 0;
  std::int32_t earliest = run.earliest;
  for (int done = 0; done < run.steps;) {
    if (count == bursts.size()) return 0;
    // A burst of one pulse fails only for its distances.
    int m = run.steps - done - 1;
    while (!prover.fits(done, m, earliest, bursts[count])) {
      if (m == 0) return 0;
      m /= 2;
    }
    ++count;
    done += m + 1;
    earliest = prover.end_ticks() + rules.gap;
  }
  return static_cast<int>(count);
}

}  // namespace ballast::firmware
