#include "sim/closed_forms/trajectories.h"

namespace ballast::closed_forms {

using firmware::detail::Attitude;
using firmware::detail::from;
using firmware::detail::Sums;
using firmware::detail::Vec;

MassTrajectories along_rails(const BallParams& ball, const MassMotion& masses) {
  MassTrajectories out;
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const firmware::RailPoint<Real> rail = firmware::evaluate<Real>(ball.rail[k], masses.position[k]);
    const Real rate = masses.velocity[k];
    out.position_B_m[k] = rail.position;
    out.velocity_B_mps[k] = rate * rail.d1;
    out.acceleration_B_mps2[k] = rate * rate * rail.d2 + masses.acceleration[k] * rail.d1;
  }
  return out;
}

Sums sums_of(const BallParams& ball, const Vec& omega, const MassTrajectories& masses, const Vec& offset,
             const Vec& u) {
  Sums sums;
  const Vec chi0 = from(ball.center_of_mass_B_m);
  sums.add(ball.shell_mass_kg, offset + chi0, cross(omega, cross(omega, chi0)), u);
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Vec chi = from(masses.position_B_m[k]);
    const Vec c =
        cross(omega, cross(omega, chi) + 2 * from(masses.velocity_B_mps[k])) + from(masses.acceleration_B_mps2[k]);
    sums.add(ball.mass_kg[k], offset + chi, c, u);
  }
  return sums;
}

RollingForces rolling_forces_3d(const BallParams& ball, const Quaternion& orientation,
                                const Vector3& angular_velocity_B_radps, const MassTrajectories& masses) {
  const Attitude lambda(orientation);
  const Vec omega = from(angular_velocity_B_radps);
  const Sums sums =
      sums_of(ball, omega, masses, ball.radius_m * lambda.gamma, firmware::detail::against_weight(ball, lambda));
  return firmware::detail::forces_of(ball, lambda, omega, sums);
}

}  // namespace ballast::closed_forms
