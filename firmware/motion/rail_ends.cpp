#include "firmware/motion/rail_ends.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ballast::firmware {

namespace {

// Of the model's numbers, with room.
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

}  // namespace ballast::firmware
