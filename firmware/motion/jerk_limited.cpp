#include "firmware/motion/jerk_limited.h"

#include <cmath>

#include "firmware/motion/cube_root.h"

namespace ballast::firmware {

namespace {

bool positive(Wide value) { return std::isfinite(value) && value > 0; }

bool usable(const MotionLimits& limits, Wide duration_s) {
  return positive(limits.max_acceleration) && positive(limits.max_jerk) && std::isfinite(duration_s);
}

// Adds a piece, unless it takes no time.
void add(PlannedPieces& pieces, Wide duration_s, Wide acceleration_start, Wide acceleration_end) {
  if (!(duration_s > 0)) return;
  pieces.piece[static_cast<std::size_t>(pieces.count++)] = {duration_s, acceleration_start, acceleration_end};
}

// Durations of the ramps a -> -peak -> 0 of the acceleration, at +-jerk.
struct Ramps {
  Wide first_s, last_s;
  Ramps(Wide a, Wide peak, Wide jerk) : first_s(std::fabs(a + peak) / jerk), last_s(peak / jerk) {}
};

// Acceleration a -> -peak, constant for constant_s unless that is negative, -> 0.
PlannedPieces through_peak(Wide a, Wide peak, Wide constant_s, Wide jerk, Wide sign) {
  const Ramps ramps(a, peak, jerk);
  PlannedPieces pieces;
  add(pieces, ramps.first_s, sign * a, -sign * peak);
  add(pieces, constant_s, -sign * peak, -sign * peak);
  add(pieces, ramps.last_s, -sign * peak, 0);
  return pieces;
}

// The constant part for which the velocity ends at 0.
Wide constant_to_rest_s(Wide v, Wide a, Wide peak, Wide jerk) {
  const Ramps ramps(a, peak, jerk);
  return (v + (a - peak) / 2 * ramps.first_s - peak / 2 * ramps.last_s) / peak;
}

// The constant part of a stop of this duration. For the peak that belongs to that duration it is the one to rest too,
// but with a small peak that would be a quotient of roundings.
Wide constant_in_time_s(Wide duration_s, Wide a, Wide peak, Wide jerk) {
  const Ramps ramps(a, peak, jerk);
  return duration_s - ramps.first_s - ramps.last_s;
}

}  // namespace

Wide PlannedPieces::duration_s() const {
  Wide sum = 0;
  for (int i = 0; i < count; ++i) sum += piece[static_cast<std::size_t>(i)].duration_s;
  return sum;
}

bool plan_stop(Wide velocity, Wide acceleration, const MotionLimits& limits, Wide duration_s, PlannedPieces& out) {
  if (!usable(limits, duration_s) || !std::isfinite(velocity) || !std::isfinite(acceleration)) return false;
  const Wide jerk = limits.max_jerk;
  // The velocity that would be left if the acceleration went straight to 0 decides the direction of braking.
  const Wide left = velocity + acceleration * std::fabs(acceleration) / (2 * jerk);
  if (!std::isfinite(left)) return false;
  // The motion counts as forward, so braking is negative.
  const Wide sign = left > 0 ? 1 : -1;
  const Wide v = sign * velocity, a = sign * acceleration;
  const bool too_hard = a < -limits.max_acceleration;
  // Down and up again without a constant part: v + a^2/(2 jerk) = peak^2 / jerk.
  const Wide peak_squared = jerk * v + a * a / 2;
  if (left == 0 || peak_squared <= 0) {  // no velocity is left, except for rounding
    PlannedPieces pieces;
    add(pieces, std::fabs(acceleration) / jerk, acceleration, 0);
    out = pieces;
    return true;
  }
  const Wide peak = too_hard ? limits.max_acceleration : std::fmin(limits.max_acceleration, std::sqrt(peak_squared));
  if (!(peak > 0)) return false;
  PlannedPieces pieces = through_peak(a, peak, constant_to_rest_s(v, a, peak, jerk), jerk, sign);
  if (duration_s > pieces.duration_s()) {
    // While the acceleration has to fall to -peak, duration = a/jerk + peak/jerk + (v + a^2/(2 jerk)) / peak. The
    // smaller root has a constant part; this form of it does not cancel.
    const Wide sum = v + a * a / (2 * jerk);
    const Wide b = jerk * duration_s - a;
    Wide lower = 2 * jerk * sum / (b + std::sqrt(std::fmax(b * b - 4 * jerk * sum, 0)));
    // While it has to rise, duration = |a|/jerk + (v - a^2/(2 jerk)) / peak.
    if (a < 0 && (too_hard || lower < -a)) lower = std::fabs(left) / (duration_s + a / jerk);
    if (lower > 0 && lower < peak)
      pieces = through_peak(a, lower, constant_in_time_s(duration_s, a, lower, jerk), jerk, sign);
  }
  if (!std::isfinite(pieces.duration_s())) return false;
  out = pieces;
  return true;
}

bool plan_move(Wide distance, const MotionLimits& limits, Wide duration_s, PlannedPieces& out) {
  if (!usable(limits, duration_s) || !positive(limits.max_velocity) || !std::isfinite(distance)) return false;
  const Wide length = std::fabs(distance);
  PlannedPieces pieces;
  if (length == 0) {
    out = pieces;
    return true;
  }
  const Wide a_max = limits.max_acceleration, jerk = limits.max_jerk;
  // Top speed: the greatest that the distance allows with the acceleration's triangle or trapezium, at most the limit.
  // Reaching v takes v / peak + peak / jerk, and so does braking; together they take v times that distance.
  const Wide triangle = a_max * a_max / jerk;  // speeds below it are reached without constant acceleration
  Wide top = 0;
  if (length >= 2 * a_max / jerk * triangle) {
    top = (std::sqrt(triangle * triangle + 4 * a_max * length) - triangle) / 2;
  } else {
    const Wide peak = cube_root(length * jerk * jerk / 2);
    top = peak * peak / jerk;
  }
  top = std::fmin(top, limits.max_velocity);
  Wide peak = std::fmin(a_max, std::sqrt(top * jerk));
  const Wide ramp = peak / jerk;
  Wide constant = std::fmax(top / peak - ramp, 0);
  Wide cruise = std::fmax(length / top - (top / peak + ramp), 0);
  // The peak is adjusted so that the rounded durations give the distance exactly, up to one rounding: the position
  // gained is peak (ramp + constant) (2 ramp + constant + cruise).
  peak = length / ((ramp + constant) * (2 * ramp + constant + cruise));
  const Wide shortest = 4 * ramp + 2 * constant + cruise;
  const Wide stretch = duration_s > shortest ? duration_s / shortest : 1;
  const Wide a = std::copysign(peak / (stretch * stretch), distance);
  add(pieces, ramp * stretch, 0, a);
  add(pieces, constant * stretch, a, a);
  add(pieces, ramp * stretch, a, 0);
  add(pieces, cruise * stretch, 0, 0);
  add(pieces, ramp * stretch, 0, -a);
  add(pieces, constant * stretch, -a, -a);
  add(pieces, ramp * stretch, -a, 0);
  if (!positive(pieces.duration_s()) || !std::isfinite(a)) return false;
  out = pieces;
  return true;
}

}  // namespace ballast::firmware
