// Searches inside one step of an integrator: for the peak of a value, and for the instant at which a condition breaks.
// Places are parts of the step, 0 at its start and 1 at its end.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace ballast::sim {

// Whether a smooth function with these values at the start, the middle and the end of a step may have a peak above
// `floor` in between. The test takes the parabola through them and allows half its bend for higher terms. A few
// searches in vain cost less than a missed peak.
inline bool may_peak_above(double v0, double vm, double v1, double floor) {
  const double bend = 2 * vm - v0 - v1;  // the parabola rises bend / 4 above its chord's middle
  const double slope_0 = 4 * vm - 3 * v0 - v1, slope_1 = v0 - 4 * vm + 3 * v1;
  if (!(slope_0 > -std::abs(bend) && slope_1 < std::abs(bend))) return false;
  return std::max({v0, vm, v1}) + std::abs(bend) / 2 > floor;
}

// The peak of the parabola through these values between start and end; -infinity if it has none there.
inline double parabola_peak(double v0, double vm, double v1) {
  const double bend = 2 * vm - v0 - v1;
  const double slope_0 = 4 * vm - 3 * v0 - v1, slope_1 = v0 - 4 * vm + 3 * v1;
  const bool inside = slope_0 > 0 && slope_1 < 0;
  return inside ? v0 + slope_0 * slope_0 / (8 * bend) : -std::numeric_limits<double>::infinity();
}

// The place in (0, 1) where f is greatest, by golden section. f is assumed to have one peak there.
template <class F>
double golden_section(F&& f) {
  constexpr double kGolden = 0.6180339887498949;
  double lo = 0, hi = 1;
  double left = hi - kGolden * (hi - lo), right = lo + kGolden * (hi - lo);
  double f_left = f(left), f_right = f(right);
  // 45 shrinkings: 4e-10 of the step, where a smooth peak is flat to rounding.
  for (int i = 0; i < 45; ++i) {
    if (f_left < f_right) {
      lo = left;
      left = right;
      f_left = f_right;
      right = lo + kGolden * (hi - lo);
      f_right = f(right);
    } else {
      hi = right;
      right = left;
      f_right = f_left;
      left = hi - kGolden * (hi - lo);
      f_left = f(left);
    }
  }
  return (lo + hi) / 2;
}

// Bisection in a step from time_s by h_s between its start, where broken(part) is false, and `broken_part`, where it is
// true, down to rounding. Returns the side where it is true, so that the condition is broken at the result.
template <class Broken>
double first_broken(double time_s, double h_s, double broken_part, Broken&& broken) {
  double good = 0, bad = broken_part;
  while (bad - good > 1e-14 && (bad - good) * h_s > 1e-15 * std::max(1.0, time_s)) {
    const double half = 0.5 * (good + bad);
    (broken(half) ? bad : good) = half;
  }
  return bad;
}

}  // namespace ballast::sim
