// The contact force and Omegadot of a rolling ball as affine functions of its rail accelerations.
//
// At one attitude, angular velocity, and position and rate of the masses, rolling_forces() is affine in u = theta'':
// c_i = c'_i + u_i zeta_i' makes the right side of eq_Om_1d affine, and nothing else in the closed forms has u. The
// columns share the sums and the inverse of the whole: n + 1 products instead of n + 1 evaluations.
//
// A floor that resists keeps the form. Its moment is N t, and t depends on Omega only, so Omegadot = Omegadot_0(u) + N
// Omegadot_1 and N = N_0(u) / (1 - (Omegadot_1 x sum m_i s_i) . Gamma): the denominator has no u. Where N_0(u) <= 0
// rolling_forces() drops the moment; the affine form continues it there, to a negative N as well.
#pragma once

#include "firmware/model/ball.h"

namespace ballast::firmware {

// Force of the surface on the ball: friction along e1 and e2, and N. Space frame.
struct AffineForces {
  Vector3 omega_dot_B_radps2 = Vector3::Zero();          // of u = 0
  PerMass<Vector3> omega_dot_per_unit = zero_vectors();  // d Omegadot / d u_i
  Vector3 force_W_n = Vector3::Zero();                   // (f_1, f_2, N) of u = 0
  PerMass<Vector3> force_per_unit = zero_vectors();      // d (f_1, f_2, N) / d u_i

  [[nodiscard]] static PerMass<Vector3> zero_vectors() {
    PerMass<Vector3> zero;
    zero.fill(Vector3::Zero());
    return zero;
  }

  [[nodiscard]] Vector3 omega_dot(int mass_count, const PerMass<Real>& u) const {
    return along(mass_count, omega_dot_B_radps2, omega_dot_per_unit, u);
  }
  [[nodiscard]] Vector3 force(int mass_count, const PerMass<Real>& u) const {
    return along(mass_count, force_W_n, force_per_unit, u);
  }

 private:
  static Vector3 along(int mass_count, const Vector3& at_zero, const PerMass<Vector3>& per_unit,
                       const PerMass<Real>& u) {
    Real x = at_zero[0], y = at_zero[1], z = at_zero[2];
    for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
      x += per_unit[i][0] * u[i];
      y += per_unit[i][1] * u[i];
      z += per_unit[i][2] * u[i];
    }
    return {x, y, z};
  }
};

// `orientation`: body -> space, unit. `masses.acceleration` is not read. Everything is NaN where a floor that resists
// leaves no N that balances the ball, whatever u is, as in rolling_forces().
void affine_forces(const BallParams& ball, const Quaternion& orientation, const Vector3& angular_velocity_B_radps,
                   const MassMotion& masses, AffineForces& out);

}  // namespace ballast::firmware
