#include "firmware/motion/tick_motion.h"

#include <array>
#include <cmath>
#include <limits>

namespace ballast::firmware {

namespace {

constexpr Wide kEndless = std::numeric_limits<Wide>::infinity();

// A motor at its step rate must not pass it by rounding.
constexpr Wide kSpeedSlack = 1e-6;

// Greatest acceleration at the tick's end for which the speed stays below `most`, if the acceleration goes to 0 at the
// greatest jerk in the ticks after that. From a' >= 0 it takes at most a' / (jerk period) + 1 whole ticks, in which the
// speed rises by at most a'^2 / (2 jerk) + a' period / 2. Where v + a period / 2 is above `most` already, a has to fall
// through 0 within the tick, at jerk (a - a') / period, and v + a^2 / (2 that jerk) = most.
Wide most_for_speed(Wide v, Wide a, Wide most, Wide jerk, Wide period_s) {
  const Wide left = most - (v + a * period_s / 2);
  if (left >= 0) {
    const Wide change = jerk * period_s;
    return std::sqrt(change * change + 2 * jerk * left) - change;
  }
  const Wide room = most - v;
  // A speed that is above `most` already, by rounding or by the motion's own start, comes back to it within the tick.
  return a > 0 && room > 0 ? a - a * a * period_s / (2 * room) : 2 * room / period_s - a;
}

// Greatest acceleration before an end that is `room` away in the direction of the speed v. The speed approaches
//   w = sqrt(beta^2 + 2 brake room) - beta,  beta = brake lag,
// which falls with at most `brake` on the way to the end and like room / lag next to it, with the time constant `lag`.
// `brake` is half the motor's acceleration, and `lag` the time in which its jerk turns the acceleration round, so that
// the acceleration can follow.
Wide most_before_end(Wide v, Wide room, const MotionLimits& limits, Wide period_s) {
  const Wide brake = limits.max_acceleration / 2;
  const Wide lag = 2 * limits.max_acceleration / limits.max_jerk + 4 * period_s;
  const Wide beta = brake * lag, sum = std::sqrt(beta * beta + 2 * brake * std::fmax(room, 0));
  return (sum - beta - v) / lag - brake * std::fmax(v, 0) / sum;
}

}  // namespace

Wide reachable_acceleration(const ProfilePoint& from, Wide wanted, const MotionLimits& limits, Wide lowest,
                            Wide highest, Wide period_s) {
  const Wide most_speed = limits.max_velocity * (1 - kSpeedSlack);
  const Wide change = limits.max_jerk * period_s;
  Wide a = std::isfinite(wanted) ? wanted : 0;
  if (highest < kEndless) a = std::fmin(a, most_before_end(from.velocity, highest - from.position, limits, period_s));
  if (lowest > -kEndless) a = std::fmax(a, -most_before_end(-from.velocity, from.position - lowest, limits, period_s));
  a = std::fmin(a, most_for_speed(from.velocity, from.acceleration, most_speed, limits.max_jerk, period_s));
  a = std::fmax(a, -most_for_speed(-from.velocity, -from.acceleration, most_speed, limits.max_jerk, period_s));
  a = std::fmin(std::fmax(a, -limits.max_acceleration), limits.max_acceleration);
  return std::fmin(std::fmax(a, from.acceleration - change), from.acceleration + change);
}

bool set_tick_motion(const ProfilePoint& from, Wide acceleration, Wide period_s, Profile& profile) {
  const std::array<ProfilePiece, 2> pieces{
      {{period_s, from.acceleration, acceleration}, {period_s, acceleration, acceleration}}};
  return profile.set(from.position, from.velocity, pieces.data(), static_cast<int>(pieces.size()));
}

}  // namespace ballast::firmware
