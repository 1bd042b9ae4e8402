// A floor whose friction and rolling resistance change with place: which patch of the surface the ball stands on, and
// where that ends. The place is the contact point's, which is the geometric centre's along e1 and e2.
//
// A patch holds its border. The ball stays on its patch, or on the floor between patches, until overdue_m() exceeds
// rounding: the borders are events between two steps of the integrator, like the ends of a regime.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

#include "sim/plant/world.h"

namespace ballast::sim {

// Distance to the patch's border in m, positive inside. NaN for a place that is not finite.
[[nodiscard]] double depth_m(const SurfacePatch& patch, const Eigen::Vector2d& place_W_m);

class LocalFloor {
 public:
  explicit LocalFloor(const Surface& surface);

  // Whether there are patches.
  [[nodiscard]] bool has_borders() const { return !patches_.empty(); }
  // Moves the ball onto the patch of a place, or onto the floor between patches.
  void stand_at(const Eigen::Vector2d& place_W_m);
  // How far a place is beyond the nearest border that the ball has to cross to leave where it stands; <= 0 where it
  // does not leave. Changes by at most as much as the place moves. Without patches -infinity.
  [[nodiscard]] double overdue_m(const Eigen::Vector2d& place_W_m) const;

  // The fault friction_falls: static friction is at most this everywhere, and the kinetic one falls in proportion.
  // Infinity: it is the surface's.
  void fall_to(double static_friction) { fallen_to_ = static_friction; }

  [[nodiscard]] double static_friction() const;
  [[nodiscard]] double kinetic_friction() const;
  [[nodiscard]] double rolling_resistance() const { return here_.rolling_resistance; }

 private:
  SurfacePatch floor_;                 // the surface between patches; has no shape
  std::vector<SurfacePatch> patches_;  // the last that holds a place counts
  std::size_t next_ = 0;               // patch under the ball plus one; 0: none
  SurfacePatch here_;                  // friction and resistance under the ball
  double fallen_to_ = std::numeric_limits<double>::infinity();
};

}  // namespace ballast::sim
