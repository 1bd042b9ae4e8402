#include "tools/sil/rest_watch.h"

#include <algorithm>
#include <cmath>

namespace ballast::sil {

RestWatch::RestWatch(const sim::Scenario& scenario) : scenario_(scenario) {
  for (const auto& mass : scenario.masses) {
    swing_s_ = std::max(swing_s_, 2 * M_PI * std::sqrt(mass.moving_inertia() / mass.motor.rail_stiffness()));
  }
}

void RestWatch::observe(const sim::Plant::Sample& sample) {
  double fastest = 0;
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    fastest = std::max(fastest, scenario_.masses[i].metres_per_rail_unit() * std::abs(sample.mass_velocity[i]));
  }
  top_mps_ = std::max(top_mps_, fastest);
  if (fastest > top_mps_ / 20) moved_s_ = sample.time_s;
  at_rest_ = top_mps_ == 0 || sample.time_s - moved_s_ >= swing_s_;
}

}  // namespace ballast::sil
