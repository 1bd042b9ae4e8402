#include "sim/plant/contact_regime.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ballast::sim {

double mu_required(double normal_force_n, double static_friction_n) {
  return normal_force_n > 0 ? static_friction_n / normal_force_n : std::numeric_limits<double>::infinity();
}

ContactRegime::ContactRegime(const PlantModel& model, double total_mass_kg)
    : static_friction(model.surface.static_friction),
      kinetic_friction(model.surface.kinetic_friction),
      radius_m(model.ball.radius_m),
      speed_scale_mps(
          std::sqrt(std::max(model.gravity_mps2, model.greatest_force_n() / total_mass_kg) * model.ball.radius_m)) {}

bool ContactRegime::over(const Instant& m) const {
  switch (regime) {
    case Regime::kRolling:
      return !(m.normal_force_n > 0) || m.static_friction_n > static_friction * m.normal_force_n;
    case Regime::kSliding:
      return !(m.normal_force_n > 0) || m.remaining < 0;
    case Regime::kFlight:
      // As flight begins, height and its rate are 0 up to rounding of either sign.
      return m.remaining < 0 &&
             (m.height_rate_mps < -kSlipVanishes * speed_scale_mps || m.remaining < -1e-12 * radius_m);
  }
  return false;
}

double ContactRegime::mu_required(const Instant& m) const {
  if (regime == Regime::kFlight) return 0;
  if (regime == Regime::kSliding) return kinetic_friction;
  return sim::mu_required(m.normal_force_n, m.static_friction_n);
}

}  // namespace ballast::sim
