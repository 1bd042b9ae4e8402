#include "sim/plant/external_force.h"

#include <algorithm>
#include <limits>

namespace ballast::sim {

ExternalForce::ExternalForce(const World& world)
    : present_(!world.external_force_W_n.isZero(0) || !world.force_table.times_s.empty() ||
               world.drag.coefficient_kgpm > 0),
      constant_W_n_(vec3(world.external_force_W_n)),
      times_s_(world.force_table.times_s),
      drag_kgpm_(world.drag.coefficient_kgpm),
      wind_W_mps_(vec3(world.drag.wind_W_mps)) {
  for (const Eigen::Vector3d& force : world.force_table.forces_W_n) forces_W_n_.push_back(vec3(force));
}

void ExternalForce::keep_told() {
  times_s_.clear();
  forces_W_n_.clear();
  drag_kgpm_ = 0;
}

Vec3<double> ExternalForce::of_table(double time_s) const {
  const auto after = std::upper_bound(times_s_.begin(), times_s_.end(), time_s);
  if (after == times_s_.begin()) return forces_W_n_.front();
  if (after == times_s_.end()) return forces_W_n_.back();
  const auto i = static_cast<std::size_t>(after - times_s_.begin());
  const double part = (time_s - times_s_[i - 1]) / (times_s_[i] - times_s_[i - 1]);
  return forces_W_n_[i - 1] + part * (forces_W_n_[i] - forces_W_n_[i - 1]);
}

double ExternalForce::next_kink_s(double time_s) const {
  const auto after = std::upper_bound(times_s_.begin(), times_s_.end(), time_s);
  return after == times_s_.end() ? std::numeric_limits<double>::infinity() : *after;
}

}  // namespace ballast::sim
