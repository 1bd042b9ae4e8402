// The paper's closed forms for a ball that rolls without slipping, with its masses on rails.
#pragma once

#include "firmware/model/ball.h"

namespace ballast::firmware {

// Omegadot (eq_Om_1d), N (eq_normal_1d) and -f_s sigma (eq_static_friction_1d) for attitude q (body -> space, unit) and
// angular velocity Omega (body frame). With mass_count = 0 these are eq_dot_Omega_static, eq_normal_static and
// eq_static_friction_static. Deviation from the paper: none. The sums run over the masses as printed, and the matrix is
// inverted by its adjugate. The paper's remark that one mass at the centre of the masses could replace them is not
// used, because it keeps sum m_i s_i but not sum m_i s_i s_i^T. Never fails for validated parameters; NaN in gives NaN
// out.
RollingForces rolling_forces(const BallParams& ball, const Quaternion& orientation,
                             const Vector3& angular_velocity_B_radps, const MassMotion& masses);

}  // namespace ballast::firmware
