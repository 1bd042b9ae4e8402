// The paper's closed forms for a ball that rolls without slipping, masses on 1-d rails or on 3-d trajectories.
#pragma once

#include "firmware/model/ball.h"

namespace ballast::firmware {

// Omegadot (eq_Om_1d), N (eq_normal_1d) and -f_s sigma (eq_static_friction_1d) for attitude q (body -> space, unit) and
// angular velocity Omega (body frame). With mass_count = 0 these are eq_dot_Omega_static, eq_normal_static and
// eq_static_friction_static. Deviation from the paper: none; the sums run over the masses as printed and the matrix is
// inverted by its adjugate. Its remark that one mass at the masses' centre would do in their place is not followed:
// that keeps sum m_i s_i but not sum m_i s_i s_i^T. Never fails for validated parameters; NaN in gives NaN out.
RollingForces rolling_forces(const BallParams& ball, const Quaternion& orientation,
                             const Vector3& angular_velocity_B_radps, const MassMotion& masses);

// The same from eq_Om, eq_normal and eq_static_friction, for masses on any trajectories; ball.rail is not read.
RollingForces rolling_forces_3d(const BallParams& ball, const Quaternion& orientation,
                                const Vector3& angular_velocity_B_radps, const MassTrajectories& masses);

// eq_1d_param: chi_i, chidot_i and chiddot_i of masses on their rails.
MassTrajectories along_rails(const BallParams& ball, const MassMotion& masses);

}  // namespace ballast::firmware
