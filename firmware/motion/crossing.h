// Times at which a cubic crosses a level, for the step generator.
#pragma once

#include <array>
#include <cmath>

#include "firmware/model/types.h"

namespace ballast::firmware {

// x(w) = x + velocity w + acceleration w^2/2 + jerk w^3/6, in microsteps (or any other unit), w in s.
struct StepCubic {
  Wide x = 0;
  Wide velocity = 0;
  Wide acceleration = 0;
  Wide jerk = 0;

  [[nodiscard]] Wide at(Wide w_s) const { return x + w_s * (velocity + w_s * (acceleration / 2 + w_s * (jerk / 6))); }
  [[nodiscard]] Wide velocity_at(Wide w_s) const { return velocity + w_s * (acceleration + w_s * (jerk / 2)); }
  [[nodiscard]] Wide acceleration_at(Wide w_s) const { return acceleration + w_s * jerk; }
};

// Ends of the monotone spans of 0 <= w <= length_s: the zeros of the velocity inside, in order, and length_s.
struct MonotoneSpans {
  int count = 0;
  std::array<Wide, 3> end_s{};
};
MonotoneSpans monotone_spans(const StepCubic& cubic, Wide length_s);

// Returns the w in [begin_s, end_s], where the cubic is monotone, at which it crosses `level`, to tolerance_s. If
// rounding puts the level outside the span, returns the nearer end. At most kMaxCrossingIterations evaluations.
inline constexpr int kMaxCrossingIterations = 150;
Wide crossing_time(const StepCubic& cubic, Wide level, Wide begin_s, Wide end_s, Wide tolerance_s);

// Improves a guess w_s by at most three steps of Newton's method, inline. True only if w_s is then proved to be the
// crossing to tolerance_s. `bend` bounds |acceleration| about the guess. With bend |step| <= |velocity| / 4 there is
// one crossing near by (Kantorovich), and the step leaves at most bend step^2 / |velocity|. `velocity` is that at the
// last point evaluated, one step away from the crossing.
[[nodiscard]] inline bool crossing_near(const StepCubic& cubic, Wide level, Wide bend, Wide tolerance_s, Wide& w_s,
                                        Wide& velocity) {
  Wide w = w_s;
  for (int i = 0; i < 3; ++i) {
    const Wide v = cubic.velocity_at(w);
    const Wide step = (level - cubic.at(w)) / v;
    const Wide bent = bend * std::fabs(step), speed = std::fabs(v);
    w += step;
    if (!(bent <= 0.25 * speed)) return false;  // also NaN
    if (bent * std::fabs(step) <= tolerance_s * speed) {
      w_s = w;
      velocity = v;
      return true;
    }
  }
  return false;
}

}  // namespace ballast::firmware
