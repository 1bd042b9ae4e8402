#include "sim/motors/end_stop.h"

#include <cmath>

namespace ballast::sim {

namespace {

// - ln e.
double loss(double damping_ratio) {
  const double d = damping_ratio;
  const double s = std::sqrt(std::abs(1 - d * d));
  if (s < 1e-8) return 2 * d;
  return 2 * d * (d < 1 ? std::acos(d) : std::acosh(d)) / s;
}

}  // namespace

double end_stop_damping_ratio(double restitution) {
  // The loss rises with D_r without bound, so bisection finds it, to rounding.
  if (restitution >= 1) return 0;
  const double wanted = -std::log(restitution);
  double low = 0, high = 1;
  while (loss(high) < wanted) high *= 2;
  for (double half = (low + high) / 2; low < half && half < high; half = (low + high) / 2) {
    (loss(half) < wanted ? low : high) = half;
  }
  return high;
}

EndStops::EndStops(const firmware::Rail& rail, double moving_inertia, const EndStopMaterial& material)
    : lower_(rail.lower_end), upper_(rail.upper_end) {
  if (!std::isfinite(lower_) || !std::isfinite(upper_)) return;
  stiffness_npm_ = material.stiffness_npm;
  time_s_ = 2 * end_stop_damping_ratio(material.restitution) * std::sqrt(moving_inertia / stiffness_npm_);
}

}  // namespace ballast::sim
