// The paper's closed forms for a ball that rolls without slipping, with its masses on rails.
#pragma once

#include "firmware/model/ball.h"

namespace ballast::firmware {

// Omegadot (eq_Om_1d), N (eq_normal_1d) and -f_s sigma (eq_static_friction_1d) for attitude q (body -> space, unit) and
// angular velocity Omega (body frame). With mass_count = 0 these are eq_dot_Omega_static, eq_normal_static and
// eq_static_friction_static. The sums run over the masses as printed, and the matrix is inverted by its adjugate. The
// paper's remark that one mass at the centre of the masses could replace them is not used, because it keeps sum m_i s_i
// but not sum m_i s_i s_i^T. Never fails for validated parameters; NaN in gives NaN out.
//
// Deviations from the paper, on real floors only (physics.md, "Real floors"):
//   - slope: the space frame is the floor's. The paper's g e3 is both weight and contact normal; here every g Gamma is
//     -Lambda^T g_W, every r Gamma stays, N gains -M g_W . e3 and friction -M g_W's part in the floor.
//   - the floor's moment T = t N: eq_Om_1d's right side gains t N. Omegadot = Omegadot_0 + N Omegadot_1 with Omegadot_1
//     the answer to t alone, so eq_normal_1d reads N = N_0 + N (Omegadot_1 x sum m_i s_i) . Gamma, and N is its
//     quotient. N_0 <= 0: no moment. A quotient's denominator <= 0: no N balances the ball, and everything is NaN.
RollingForces rolling_forces(const BallParams& ball, const Quaternion& orientation,
                             const Vector3& angular_velocity_B_radps, const MassMotion& masses);

}  // namespace ballast::firmware
