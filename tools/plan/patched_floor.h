// A floor with patches as the planner takes it: what friction there costs and how it resists, by place. Values that
// jump at a border are blended over a band beside it, so that a step of the solver sees the border ahead. The plant,
// whose borders are sharp, judges the plan.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "sim/plant/world.h"

namespace ballast::plan {

class PatchedFloor {
 public:
  PatchedFloor() = default;  // the same everywhere
  PatchedFloor(const sim::Surface& surface, double ball_radius_m);

  [[nodiscard]] bool has_patches() const { return !patches_.empty(); }
  // The mu_s whose weight is 1: the floor's, or the least of the patches where the floor's is infinite.
  [[nodiscard]] double reference_friction() const { return reference_; }

  // Reference over mu_s, by which f_s / N counts. At least 1 on a finite floor: more grip than the floor's is not used,
  // since the monitor trips by the floor's. 0 where friction is infinite.
  struct Weight {
    double value = 1;
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();  // by the place, 1/m
  };
  // At least that of every place within margin_m.
  [[nodiscard]] Weight weight(const Eigen::Vector2d& place_m, double margin_m) const;
  // That of the place, as the plant has it.
  [[nodiscard]] double weight_at(const Eigen::Vector2d& place_m) const;
  // The least within a distance: what a ball that may stop anywhere there needs.
  [[nodiscard]] double least_weight(const Eigen::Vector2d& place_m, double within_m) const;

  // c_rr, blended across borders.
  [[nodiscard]] double rolling_resistance(const Eigen::Vector2d& place_m) const;
  [[nodiscard]] double greatest_rolling_resistance() const { return greatest_resistance_; }

 private:
  [[nodiscard]] double weight_of(double static_friction) const;

  std::vector<sim::SurfacePatch> patches_;
  std::vector<double> weights_;
  double floor_weight_ = 1, floor_resistance_ = 0, greatest_resistance_ = 0;
  double reference_ = std::numeric_limits<double>::infinity();
  bool grip_is_bounded_ = false;
  double band_m_ = 0;
};

}  // namespace ballast::plan
