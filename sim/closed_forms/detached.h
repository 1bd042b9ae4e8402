// The paper's closed forms for a ball and a disk in the air, N = f_s = 0 (paper, app_detachment).
#pragma once

#include "sim/closed_forms/trajectories.h"

namespace ballast::closed_forms {

struct DetachedMotion {
  Vector3 angular_acceleration_B_radps2 = Vector3::Zero();  // Omegadot
  Vector3 acceleration_W_mps2 = Vector3::Zero();            // zddot_GC, of the geometric centre
};

struct DetachedDiskMotion {
  Real angular_acceleration_radps2 = 0;           // phiddot
  Vector3 acceleration_W_mps2 = Vector3::Zero();  // zddot_GC; its component 2 is 0
};

// Omegadot and zddot_GC: eq_detach_ball_1d for masses on their rails, eq_detach_dOm and eq_ddot_z_GC for masses on any
// trajectories (ball.rail is not read). With mass_count = 0 they are eq_detach_ball_static. Attitude q (body -> space,
// unit) and angular velocity Omega (body frame) are those of rolling.h. Never fails for validated parameters; NaN in
// gives NaN out. Deviations from the paper: gravity points along ball.down_W, and the
// inner sums over j are carried out. With X = sum m_j chi_j / M, the
// centre of mass,
//   sum_j (m_j / M - delta_ij) chi_j = X - chi_i = -d_i,   sum m_i d_i = 0,
// which leaves n + 1 terms of the paper's (n + 1)^2 and a symmetric matrix, ^ being the cross-product matrix:
//   [I - sum m_i d_i^ d_i^] Omegadot = I Omega x Omega - X x Gamma~ - sum m_i d_i x c_i,
//   c_i = Omega x (Omega x chi_i + 2 chidot_i) + chiddot_i.
DetachedMotion detached_motion(const BallParams& ball, const Quaternion& orientation,
                               const Vector3& angular_velocity_B_radps, const MassMotion& masses);
DetachedMotion detached_motion_3d(const BallParams& ball, const Quaternion& orientation,
                                  const Vector3& angular_velocity_B_radps, const MassTrajectories& masses);
// Own columns: a rotation phi of the ball in its body frame, Lambda -> Lambda exp(phi^) (3), and Omega (3).
Derivative<DetachedMotion> detached_motion_derivative(const BallParams& ball, const Quaternion& orientation,
                                                      const Vector3& angular_velocity_B_radps,
                                                      const MassMotion& masses);

// phiddot and zddot_GC of eq_detach_disk_1d, over a level floor, with its P_i, Q_i and V_ij; with mass_count = 0,
// eq_detach_disk_static. rolling_disk.h defines the plane and phi, and says what is read of `ball`. Deviation from the
// paper: the sums over j are carried out as above, which leaves, divided by M and with d_i = zeta_i - X,
//   phiddot = [F_e,1 (X_1 sin phi + X_3 cos phi) - F_e,3 (X_1 cos phi - X_3 sin phi)
//              - sum m_i (d_i,1 P_i - d_i,3 Q_i)] / [d_2 + sum m_i |d_i|^2].
DetachedDiskMotion detached_disk_motion(const BallParams& ball, const DiskState& disk, const MassMotion& masses);
// Own columns: phi and phidot.
Derivative<DetachedDiskMotion> detached_disk_motion_derivative(const BallParams& ball, const DiskState& disk,
                                                               const MassMotion& masses);

}  // namespace ballast::closed_forms
