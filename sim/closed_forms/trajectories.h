// The closed forms for masses on any trajectories, rolling, and the sums that they share with the detached ones.
#pragma once

#include "firmware/model/ball_sums.h"
#include "sim/closed_forms/rolling_disk.h"

namespace ballast::closed_forms {

using firmware::RollingForces;

// chi_i from the geometric centre, and its first two time derivatives as the body frame sees them. Entries from
// mass_count on are not read.
template <class T>
struct MassTrajectoriesOf {
  using Vector = Eigen::Matrix<T, 3, 1>;
  firmware::PerMass<Vector> position_B_m;
  firmware::PerMass<Vector> velocity_B_mps;
  firmware::PerMass<Vector> acceleration_B_mps2;
};
using MassTrajectories = MassTrajectoriesOf<Real>;

// eq_1d_param: chi_i, chidot_i and chiddot_i of masses on their rails. The template is for ComplexMotion.
MassTrajectories along_rails(const BallParams& ball, const MassMotion& masses);
template <class T, class Motion>
MassTrajectoriesOf<T> along_rails_of(const BallParams& ball, const Motion& masses) {
  MassTrajectoriesOf<T> out;
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const firmware::RailPoint<T> rail = firmware::evaluate<T>(ball.rail[k], masses.position[k]);
    const T rate = masses.velocity[k];
    out.position_B_m[k] = rail.position;
    out.velocity_B_mps[k] = rate * rail.d1;
    out.acceleration_B_mps2[k] = rate * rate * rail.d2 + masses.acceleration[k] * rail.d1;
  }
  return out;
}

// The sums of shell and masses with the levers chi_i + `offset`, and u.
template <class T>
firmware::detail::SumsOf<T> sums_of(const BallParams& ball, const firmware::detail::VecOf<T>& omega,
                                    const MassTrajectoriesOf<T>& masses, const firmware::detail::VecOf<T>& offset,
                                    const firmware::detail::Vec& u) {
  using firmware::detail::from;
  firmware::detail::SumsOf<T> sums;
  const firmware::detail::Vec chi0 = from(ball.center_of_mass_B_m);
  sums.add(ball.shell_mass_kg, offset + chi0, cross(omega, cross(omega, chi0)), u);
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const auto chi = from(masses.position_B_m[k]);
    const auto c = cross(omega, cross(omega, chi) + Real(2) * from(masses.velocity_B_mps[k])) +
                   from(masses.acceleration_B_mps2[k]);
    sums.add(ball.mass_kg[k], offset + chi, c, u);
  }
  return sums;
}

// eq_Om, eq_normal and eq_static_friction; ball.rail is not read. Otherwise as firmware::rolling_forces().
RollingForces rolling_forces_3d(const BallParams& ball, const Quaternion& orientation,
                                const Vector3& angular_velocity_B_radps, const MassTrajectories& masses);

}  // namespace ballast::closed_forms
