#include "firmware/motion/rail_ends.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "firmware/motion/crossing.h"

namespace ballast::firmware {

namespace {

// A few roundings of the model's numbers.
constexpr Real kRounding = std::max(Real(1e-12), 16 * std::numeric_limits<Real>::epsilon());

}  // namespace

bool on_rail(const BallParams& ball, int mass, Wide rail_coordinate) {
  const auto position = static_cast<Real>(rail_coordinate);
  const Rail& rail = ball.rail[static_cast<std::size_t>(mass)];
  const Real between = rail.upper_end - rail.lower_end;
  const Real rounding = kRounding * (std::isfinite(between) ? between : std::fabs(position));
  if (position < rail.lower_end - rounding || position > rail.upper_end + rounding) return false;
  if (rail.shape == RailShape::kSpline && !rail.closed) {
    const Real length = length_m(rail);
    return position >= -kRounding * length && position <= length * (1 + kRounding);
  }
  if (rail.shape != RailShape::kLine) return true;
  const Vector3 r = evaluate(rail, position).position;
  return std::sqrt(r.dot(r)) <= ball.radius_m * (1 + kRounding);
}

RailEnds rail_ends(const BallParams& ball, int mass) {
  const Rail& rail = ball.rail[static_cast<std::size_t>(mass)];
  RailEnds ends{Wide{rail.lower_end}, Wide{rail.upper_end}};
  if (rail.shape == RailShape::kSpline && !rail.closed) {
    ends = {std::fmax(ends.lower, 0.0), std::fmin(ends.upper, Wide{length_m(rail)})};
  }
  if (rail.shape == RailShape::kLine) {
    // |origin + s direction| = r.
    const Wide along{rail.origin_B_m.dot(rail.axis_cos_B)}, square{rail.origin_B_m.dot(rail.origin_B_m)};
    const Wide half = std::sqrt(Wide{ball.radius_m} * Wide{ball.radius_m} - (square - along * along));
    ends = {half >= 0 ? std::fmax(ends.lower, -along - half) : half,
            half >= 0 ? std::fmin(ends.upper, -along + half) : half};
  }
  return ends;
}

LeavesRail leaves_rail(const BallParams& ball, int mass, const Profile& profile) {
  for (int p = 0; p < profile.piece_count(); ++p) {
    const Cubic& c = profile.cubic(p);
    const StepCubic x{c.position, c.velocity, c.acceleration, c.jerk};
    const MonotoneSpans spans = monotone_spans(x, c.duration_s);
    for (int k = 0; k < spans.count; ++k) {
      const Wide position = x.at(spans.end_s[static_cast<std::size_t>(k)]);
      if (!on_rail(ball, mass, position)) return {p, position};
    }
  }
  return {};
}

}  // namespace ballast::firmware
