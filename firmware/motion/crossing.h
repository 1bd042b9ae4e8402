// When a cubic crosses a level: the mathematics under the step generator.
#pragma once

#include <array>

#include "firmware/model/types.h"

namespace ballast::firmware {

// x(w) = x + velocity w + acceleration w^2/2 + jerk w^3/6, in microsteps, w in s.
struct StepCubic {
  Real x = 0;
  Real velocity = 0;
  Real acceleration = 0;
  Real jerk = 0;

  [[nodiscard]] Real at(Real w_s) const { return x + w_s * (velocity + w_s * (acceleration / 2 + w_s * (jerk / 6))); }
  [[nodiscard]] Real velocity_at(Real w_s) const { return velocity + w_s * (acceleration + w_s * (jerk / 2)); }
};

// Ends of the monotone spans of 0 <= w <= length_s: the zeros of the velocity inside, in order, and length_s.
struct MonotoneSpans {
  int count = 0;
  std::array<Real, 3> end_s{};
};
MonotoneSpans monotone_spans(const StepCubic& cubic, Real length_s);

// The w in [begin_s, end_s], where the cubic is monotone, at which it crosses `level`, to tolerance_s. If rounding has
// put the level outside the span, the end of the span nearer to it. At most kMaxCrossingIterations evaluations.
inline constexpr int kMaxCrossingIterations = 150;
Real crossing_time(const StepCubic& cubic, Real level, Real begin_s, Real end_s, Real tolerance_s);

}  // namespace ballast::firmware
