#include "firmware/motion/motion_limits.h"

#include <algorithm>
#include <cmath>

#include "firmware/motion/crossing.h"

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
      const Wide turn = -c.acceleration / c.jerk;  // NaN or infinite without jerk: no extreme inside
      if (turn > 0 && turn < d) speed = std::fmax(speed, std::fabs(c.velocity + turn * c.acceleration / 2));
      acceleration = std::fmax(std::fabs(c.acceleration), std::fabs(c.acceleration + d * c.jerk));
    }
    if (above(speed, limits.max_velocity)) return {Limited::kVelocity, i, speed};
    if (above(acceleration, limits.max_acceleration)) return {Limited::kAcceleration, i, acceleration};
    if (above(std::fabs(c.jerk), limits.max_jerk)) return {Limited::kJerk, i, std::fabs(c.jerk)};
  }
  return {};
}

int most_reversals(const Profile& profile, Wide control_period_s, Wide added_velocity) {
  int most = 0, reversals = 0, direction = 0;
  Wide tick = -1;  // the control tick that `reversals` counts
  for (int i = 0; i <= profile.piece_count(); ++i) {
    const Cubic& c = profile.cubic(i);
    const StepCubic x{0, c.velocity + added_velocity, c.acceleration, c.jerk};
    // The tail has constant velocity, so any length shows its direction.
    const MonotoneSpans spans = monotone_spans(x, i < profile.piece_count() ? c.duration_s : 1);
    Wide begin_s = 0;
    for (int k = 0; k < spans.count; ++k) {
      const Wide end_s = spans.end_s[static_cast<std::size_t>(k)], moved = x.at(end_s) - x.at(begin_s);
      const int now = moved > 0 ? 1 : (moved < 0 ? -1 : direction);
      if (now * direction < 0) {
        const Wide in_tick = std::floor((profile.cubic_start_s(i) + begin_s) / control_period_s);
        reversals = in_tick == tick ? reversals + 1 : 1;
        tick = in_tick;
        most = std::max(most, reversals);
      }
      direction = now;
      begin_s = end_s;
    }
  }
  return most;
}

}  // namespace ballast::firmware
