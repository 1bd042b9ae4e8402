#include "tools/stepcheck/motion_crossings.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace ballast::stepcheck {

namespace {

constexpr long double kInfinity = std::numeric_limits<long double>::infinity();

// Appends the places inside (0, length) at which the velocity changes sign, and the length.
void add_turns(const MotionInSteps::Part& p, long double length_s, std::vector<long double>& ends_s) {
  const long double q = p.j / 2;
  std::vector<long double> roots;
  if (q == 0) {
    if (p.a != 0) roots.push_back(-p.v / p.a);
  } else {
    // About the vertex, which needs no case by sign: w = vertex +- sqrt(...), then two steps of Newton's method.
    const long double vertex = -p.a / (2 * q), square = vertex * vertex - p.v / q;
    if (square > 0) {
      for (const long double sign : {-1.0L, 1.0L}) {
        long double w = vertex + sign * std::sqrt(square);
        for (int i = 0; i < 2; ++i) {
          const long double slope = p.a + w * p.j;
          if (slope != 0) w -= p.velocity(w) / slope;
        }
        roots.push_back(w);
      }
    }
  }
  std::sort(roots.begin(), roots.end());
  for (const long double w : roots) {
    if (w > 0 && w < length_s) ends_s.push_back(w);
  }
  ends_s.push_back(length_s);
}

// The place at which the part crosses the level, by bisection and false position. The bracket closes for any cubic.
long double root(const MotionInSteps::Part& p, long double level, int direction, long double low, long double high) {
  const auto side = [&](long double w) { return direction * (p.at(w) - level); };
  if (side(low) >= 0) return low;
  for (int i = 0; i < 200; ++i) {
    const long double f_low = side(low), f_high = side(high);
    if (f_high <= 0) return high;
    const long double width = high - low;
    if (width <= 1e-13L) break;  // s; far below any timer tick
    // False position, moved a little towards the far end, so that both ends close in.
    long double guess = low - f_low * width / (f_high - f_low);
    const long double nudge = std::max(1e-14L, width * 1e-6L);
    guess += f_high > -f_low ? nudge : -nudge;
    for (const long double w : {guess, low + width / 2}) {
      if (!(w > low && w < high)) continue;
      (side(w) < 0 ? low : high) = w;
    }
  }
  return low + (high - low) / 2;
}

}  // namespace

MotionInSteps::MotionInSteps(const Motion& motion) {
  const long double k = motion.microsteps_per_unit;
  start_steps_ = std::fabs(k * motion.position);
  long double t = 0, x = k * motion.from_zero, v = k * motion.velocity;
  for (const Piece& piece : motion.pieces) {
    const long double d = piece.duration_s, a0 = k * piece.acceleration_start, a1 = k * piece.acceleration_end;
    parts_.push_back({t, x, v, a0, (a1 - a0) / d});
    x = parts_.back().at(d);
    v += d * (a0 + a1) / 2;
    t += d;
  }
  // A motion that comes to rest is at rest, though sums of doubles leave a rest of rounding.
  long double fastest = std::fabs(k * motion.velocity);
  for (const Part& part : parts_) fastest = std::max(fastest, std::fabs(part.v));
  if (std::fabs(v) <= 1e-14L * static_cast<long double>(motion.pieces.size()) * fastest) v = 0;
  parts_.push_back({t, x, v, 0, 0});
}

MotionInSteps::MotionInSteps(const SampledMotion& motion) {
  const long double k = motion.microsteps_per_unit, period = motion.period_s;
  start_steps_ = std::fabs(k * motion.position.front());
  unknown_steps_ = std::fabs(k) * motion.max_jerk * period * period * period / 24;
  const auto x = [&](std::size_t i) { return k * (static_cast<long double>(motion.position[i]) - motion.zero); };
  const auto v = [&](std::size_t i) { return k * motion.velocity[i]; };
  const std::size_t last = motion.position.size() - 1;
  for (std::size_t i = 0; i < last; ++i) {
    const long double mean = (x(i + 1) - x(i)) / period;
    parts_.push_back({static_cast<long double>(i) * period, x(i), v(i), (6 * mean - 4 * v(i) - 2 * v(i + 1)) / period,
                      (6 * (v(i) + v(i + 1)) - 12 * mean) / (period * period)});
  }
  parts_.push_back({static_cast<long double>(last) * period, x(last), v(last), 0, 0});
}

long double MotionInSteps::at(long double time_s) const {
  if (time_s <= 0) return parts_.front().x;
  const auto next = std::upper_bound(parts_.begin(), parts_.end(), time_s,
                                     [](long double time, const Part& part) { return time < part.start_s; });
  const Part& part = *std::prev(next);
  return part.at(time_s - part.start_s);
}

long double MotionInSteps::rounding(long double steps) const {
  return 1e-9L + 2e-15L * (start_steps_ + std::fabs(steps)) + unknown_steps_;
}

Crossings::Crossings(const MotionInSteps& motion, std::int64_t count) : motion_(motion), count_(count) {}

bool Crossings::open_span() {
  const auto& parts = motion_.parts();
  if (ends_s_.empty()) {
    const bool last = part_ + 1 == parts.size();
    const long double length = last ? kInfinity : parts[part_ + 1].start_s - parts[part_].start_s;
    if (last) {
      ends_s_.push_back(kInfinity);
    } else {
      add_turns(parts[part_], length, ends_s_);
    }
    span_ = 0;
    begin_s_ = 0;
    end_s_ = ends_s_[0];
    return true;
  }
  if (++span_ < ends_s_.size()) {
    begin_s_ = end_s_;
    end_s_ = ends_s_[span_];
    return true;
  }
  if (part_ + 1 == parts.size()) return false;
  ++part_;
  ends_s_.clear();
  return open_span();
}

bool Crossings::next(long double until_s, Crossing& crossing) {
  if (ends_s_.empty()) open_span();
  until_s = until_s_ = std::max(until_s_, until_s);  // looking back would see the count ahead of the motion
  for (;;) {
    const MotionInSteps::Part& p = motion_.parts()[part_];
    const long double horizon = std::min(end_s_, until_s - p.start_s);
    if (horizon > begin_s_) {
      const long double x = p.at(horizon), ahead = x - static_cast<long double>(count_);
      if (std::fabs(ahead) > 0.5L + motion_.rounding(x)) {
        const int direction = ahead > 0 ? 1 : -1;
        const long double level = static_cast<long double>(count_) + 0.5L * direction;
        crossing = {p.start_s + root(p, level, direction, begin_s_, horizon), direction, count_};
        count_ += direction;
        return true;
      }
    }
    if (until_s - p.start_s <= end_s_) return false;
    if (!open_span()) return false;
  }
}

}  // namespace ballast::stepcheck
