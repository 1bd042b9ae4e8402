#include "sim/plant/external_force.h"

#include <algorithm>
#include <limits>

namespace ballast::sim {

ExternalForce::ExternalForce(const Scenario& scenario)
    : present_(!scenario.external_force_W_n.isZero(0) || !scenario.force_table.times_s.empty() ||
               scenario.drag.coefficient_kgpm > 0 ||
               std::any_of(scenario.faults.begin(), scenario.faults.end(),
                           [](const Fault& fault) { return fault.kind == FaultKind::kPush; })),
      constant_W_n_(vec3(scenario.external_force_W_n)),
      times_s_(scenario.force_table.times_s),
      drag_kgpm_(scenario.drag.coefficient_kgpm),
      wind_W_mps_(vec3(scenario.drag.wind_W_mps)) {
  for (const Eigen::Vector3d& force : scenario.force_table.forces_W_n) forces_W_n_.push_back(vec3(force));
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
