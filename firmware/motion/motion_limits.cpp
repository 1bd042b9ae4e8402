#include "firmware/motion/motion_limits.h"

#include <cmath>

namespace ballast::firmware {

namespace {

constexpr Wide kRoundOff = 1e-9;

bool above(Wide value, Wide limit) { return !(value <= limit * (1 + kRoundOff)); }

}  // namespace

LimitBreach check_limits(const Profile& profile, const MotionLimits& limits) {
  for (int i = 0; i <= profile.piece_count(); ++i) {
    const Cubic& c = profile.cubic(i);
    Wide speed = std::fabs(c.velocity), acceleration = 0;
    if (i < profile.piece_count()) {
      const Wide d = c.duration_s;
      speed = std::fmax(speed, std::fabs(c.velocity + d * (c.acceleration + d * c.jerk / 2)));
      const Wide turn = -c.acceleration / c.jerk;  // NaN or infinite without jerk: then nothing turns
      if (turn > 0 && turn < d) speed = std::fmax(speed, std::fabs(c.velocity + turn * c.acceleration / 2));
      acceleration = std::fmax(std::fabs(c.acceleration), std::fabs(c.acceleration + d * c.jerk));
    }
    if (above(speed, limits.max_velocity)) return {Limited::kVelocity, i, speed};
    if (above(acceleration, limits.max_acceleration)) return {Limited::kAcceleration, i, acceleration};
    if (above(std::fabs(c.jerk), limits.max_jerk)) return {Limited::kJerk, i, std::fabs(c.jerk)};
  }
  return {};
}

}  // namespace ballast::firmware
