// The paper's closed forms for a ball that rolls without slipping, masses on 1-d rails or on 3-d trajectories.
#pragma once

#include "firmware/model/rail.h"

namespace ballast::firmware {

// What the model knows of the robot. Symbols: physics.md section 1.
struct BallParams {
  Real radius_m = 0;                             // r > 0
  Real gravity_mps2 = 0;                         // g >= 0
  Real shell_mass_kg = 0;                        // m_0 > 0
  Vector3 inertia_kgm2 = Vector3::Zero();        // diag(I), about m_0's own centre of mass, body frame
  Vector3 center_of_mass_B_m = Vector3::Zero();  // chi_0, from the geometric centre
  Vector3 external_force_W_n = Vector3::Zero();  // F_e, constant, at the geometric centre, space frame
  int mass_count = 0;                            // n, 0..kMaxMasses
  PerMass<Real> mass_kg{};                       // m_i > 0
  PerMass<Rail> rail{};
};

// Rail coordinates and their first two time derivatives (rad or m, per s, per s^2).
struct MassMotion {
  PerMass<Real> position{};
  PerMass<Real> velocity{};
  PerMass<Real> acceleration{};
};

// Masses wherever they are: chi_i from the geometric centre, and its first two time derivatives as the body frame sees
// them. Entries from mass_count on are not read.
struct MassTrajectories {
  PerMass<Vector3> position_B_m;
  PerMass<Vector3> velocity_B_mps;
  PerMass<Vector3> acceleration_B_mps2;
};

struct RollingForces {
  Vector3 angular_acceleration_B_radps2 = Vector3::Zero();
  Real normal_force_n = 0;                       // N, positive upward
  Vector2 friction_force_W_n = Vector2::Zero();  // force of the surface on the ball, -f_s sigma, space frame
  Real static_friction_n = 0;                    // f_s
};

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
