#include "tools/sil/rest_watch.h"

#include <algorithm>
#include <cmath>

namespace ballast::sil {

namespace {

// Metres that a mass moves per unit of its rail's coordinate.
double lever_m(const sim::Mass& mass) {
  return mass.rail.shape == firmware::RailShape::kCircle ? mass.rail.radius_m : 1;
}

}  // namespace

RestWatch::RestWatch(const sim::Scenario& scenario) : scenario_(scenario) {
  for (const auto& mass : scenario.masses) {
    const double inertia = mass.mass_kg * lever_m(mass) * lever_m(mass) + mass.motor.rail_inertia();
    swing_s_ = std::max(swing_s_, 2 * M_PI * std::sqrt(inertia / mass.motor.rail_stiffness()));
  }
}

void RestWatch::observe(const sim::Plant::Sample& sample) {
  double fastest = 0;
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    fastest = std::max(fastest, lever_m(scenario_.masses[i]) * std::abs(sample.mass_velocity[i]));
  }
  top_mps_ = std::max(top_mps_, fastest);
  if (fastest > top_mps_ / 20) moved_s_ = sample.time_s;
  at_rest_ = top_mps_ == 0 || sample.time_s - moved_s_ >= swing_s_;
}

}  // namespace ballast::sil
