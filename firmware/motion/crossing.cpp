#include "firmware/motion/crossing.h"

#include <cmath>

namespace ballast::firmware {

MonotoneSpans monotone_spans(const StepCubic& cubic, Wide length_s) {
  // velocity + acceleration w + (jerk/2) w^2 = 0 in the form that does not cancel. A missing root is NaN or infinite
  // and fails the comparison below. A double root is no reversal, so it may be lost.
  const Wide a = cubic.jerk / 2, b = cubic.acceleration, c = cubic.velocity;
  const Wide discriminant = b * b - 4 * a * c;
  Wide first = -1, second = -1;
  if (discriminant >= 0) {
    const Wide q = -(b + std::copysign(std::sqrt(discriminant), b)) / 2;
    first = c / q;
    second = q / a;
    if (second < first) {
      const Wide swap = first;
      first = second;
      second = swap;
    }
  }
  MonotoneSpans spans;
  for (const Wide root : {first, second}) {
    if (root > 0 && root < length_s) spans.end_s[static_cast<std::size_t>(spans.count++)] = root;
  }
  spans.end_s[static_cast<std::size_t>(spans.count++)] = length_s;
  return spans;
}

Wide crossing_time(const StepCubic& cubic, Wide level, Wide begin_s, Wide end_s, Wide tolerance_s) {
  const Wide x_begin = cubic.at(begin_s), x_end = cubic.at(end_s);
  const Wide sign = x_end > x_begin ? 1 : -1;
  if (sign * (x_begin - level) >= 0) return begin_s;
  if (sign * (x_end - level) <= 0) return end_s;

  Wide low = begin_s, high = end_s;  // before and after the crossing
  Wide w = begin_s + (end_s - begin_s) * ((level - x_begin) / (x_end - x_begin));
  for (int i = 1; i <= kMaxCrossingIterations && high - low > tolerance_s; ++i) {
    const Wide excess = sign * (cubic.at(w) - level);
    if (excess == 0) return w;
    if (excess < 0) {
      low = w;
    } else {
      high = w;
    }
    Wide next = w - excess / (sign * cubic.velocity_at(w));
    // Newton inside the bracket, and bisection every third time, so that the bracket closes for every cubic.
    if (i % 3 == 0 || !(next > low && next < high)) {
      next = low + (high - low) / 2;
    } else if (std::fabs(next - w) <= tolerance_s) {
      return next;
    }
    w = next;
  }
  return w;
}

}  // namespace ballast::firmware
