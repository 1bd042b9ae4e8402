#include "sim/plant/local_floor.h"

#include <algorithm>
#include <cmath>

namespace ballast::sim {

using Eigen::Vector2d;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double squared_distance(const Vector2d& place, const Vector2d& from, const Vector2d& to) {
  const Vector2d along = to - from, offset = place - from;
  const double part = std::clamp(offset.dot(along) / along.squaredNorm(), 0.0, 1.0);
  return (offset - part * along).squaredNorm();
}

}  // namespace

double depth_m(const SurfacePatch& patch, const Vector2d& place_W_m) {
  if (!place_W_m.allFinite()) return std::numeric_limits<double>::quiet_NaN();
  if (patch.polygon_W_m.empty()) return patch.radius_m - (place_W_m - patch.center_W_m).norm();
  // Inside, a ray along e1 crosses an odd number of edges.
  bool inside = false;
  double nearest = kInfinity;
  Vector2d from = patch.polygon_W_m.back();
  for (const Vector2d& to : patch.polygon_W_m) {
    nearest = std::min(nearest, squared_distance(place_W_m, from, to));
    if ((from[1] > place_W_m[1]) != (to[1] > place_W_m[1])) {
      const double part = (place_W_m[1] - from[1]) / (to[1] - from[1]);
      inside ^= place_W_m[0] < from[0] + part * (to[0] - from[0]);
    }
    from = to;
  }
  return inside ? std::sqrt(nearest) : -std::sqrt(nearest);
}

LocalFloor::LocalFloor(const Surface& surface) : patches_(surface.patches) {
  floor_.static_friction = surface.static_friction;
  floor_.kinetic_friction = surface.kinetic_friction;
  floor_.rolling_resistance = surface.rolling_resistance;
  here_ = floor_;
}

void LocalFloor::stand_at(const Vector2d& place_W_m) {
  next_ = patches_.size();
  while (next_ > 0 && !(depth_m(patches_[next_ - 1], place_W_m) >= 0)) --next_;
  const SurfacePatch& under = next_ > 0 ? patches_[next_ - 1] : floor_;
  here_.static_friction = under.static_friction;
  here_.kinetic_friction = under.kinetic_friction;
  here_.rolling_resistance = under.rolling_resistance;
}

double LocalFloor::overdue_m(const Vector2d& place_W_m) const {
  double overdue = next_ > 0 ? -depth_m(patches_[next_ - 1], place_W_m) : -kInfinity;
  for (std::size_t i = next_; i < patches_.size(); ++i) {
    overdue = std::max(overdue, depth_m(patches_[i], place_W_m));
  }
  return overdue;
}

double LocalFloor::static_friction() const { return std::min(here_.static_friction, fallen_to_); }

double LocalFloor::kinetic_friction() const {
  const double fallen = static_friction();
  if (!(fallen < here_.static_friction)) return here_.kinetic_friction;
  return std::isinf(here_.static_friction) ? std::min(here_.kinetic_friction, fallen)
                                           : here_.kinetic_friction * (fallen / here_.static_friction);
}

}  // namespace ballast::sim
