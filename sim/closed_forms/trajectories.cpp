#include "sim/closed_forms/trajectories.h"

namespace ballast::closed_forms {

using firmware::detail::Attitude;
using firmware::detail::from;
using firmware::detail::Sums;
using firmware::detail::Vec;

MassTrajectories along_rails(const BallParams& ball, const MassMotion& masses) {
  return along_rails_of<Real>(ball, masses);
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
