#include "sim/closed_forms/detached.h"

#include <array>
#include <cmath>

#include "sim/closed_forms/disk_mass.h"

namespace ballast::closed_forms {

using firmware::kMaxMasses;
using firmware::sin_cos;
using firmware::detail::Attitude;
using firmware::detail::from;
using firmware::detail::Sums;
using firmware::detail::Vec;

DetachedMotion detached_motion_3d(const BallParams& ball, const Quaternion& orientation,
                                  const Vector3& angular_velocity_B_radps, const MassTrajectories& masses) {
  const Attitude lambda(orientation);
  const Vec omega = from(angular_velocity_B_radps);
  const Vec inertia = from(ball.inertia_kgm2);
  const Vec chi0 = from(ball.center_of_mass_B_m);
  const Vec force_W = from(ball.external_force_W_n);

  Real mass = ball.shell_mass_kg;
  Vec mass_chi = ball.shell_mass_kg * chi0;
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    mass += ball.mass_kg[k];
    mass_chi = mass_chi + ball.mass_kg[k] * from(masses.position_B_m[k]);
  }
  const Vec center = (1 / mass) * mass_chi;  // X

  // Levers d_i = chi_i - X. Gravity has no torque about X.
  const Sums sums = sums_of(ball, omega, masses, -1 * center, {0, 0, 0});
  const Vec omega_dot =
      sums.solve(inertia, gyroscopic(inertia, omega) + cross(center, lambda.to_B(force_W)) + sums.torque);

  // eq_ddot_z_GC.
  const Vec inertial = cross(omega_dot, center) + (1 / mass) * sums.mass_c;
  const Vec weight_W = ball.gravity_mps2 * from(ball.down_W);  // per mass
  DetachedMotion out;
  out.angular_acceleration_B_radps2 = Vector3(omega_dot.x, omega_dot.y, omega_dot.z);
  out.acceleration_W_mps2 = Vector3(force_W.x / mass + weight_W.x - dot(lambda.row1, inertial),
                                    force_W.y / mass + weight_W.y - dot(lambda.row2, inertial),
                                    force_W.z / mass + weight_W.z - dot(lambda.gamma, inertial));
  return out;
}

DetachedMotion detached_motion(const BallParams& ball, const Quaternion& orientation,
                               const Vector3& angular_velocity_B_radps, const MassMotion& masses) {
  return detached_motion_3d(ball, orientation, angular_velocity_B_radps, along_rails(ball, masses));
}

DetachedDiskMotion detached_disk_motion(const BallParams& ball, const DiskState& disk, const MassMotion& masses) {
  const auto [sin_phi, cos_phi] = sin_cos(disk.angle_rad);
  const Real force1 = ball.external_force_W_n[0], force3 = ball.external_force_W_n[2];

  std::array<DiskMass, kMaxMasses + 1> all;
  Real mass = 0, mass_zeta1 = 0, mass_zeta3 = 0, mass_q = 0, mass_p = 0;
  for (int i = -1; i < ball.mass_count; ++i) {
    const DiskMass m = disk_mass(ball, disk, masses, i);
    all[static_cast<std::size_t>(i + 1)] = m;
    mass += m.mass;
    mass_zeta1 += m.mass * m.zeta1;
    mass_zeta3 += m.mass * m.zeta3;
    mass_q += m.mass * m.q;
    mass_p += m.mass * m.p;
  }
  const Real center1 = mass_zeta1 / mass, center3 = mass_zeta3 / mass;  // X

  Real inertia = ball.inertia_kgm2[1];
  Real torque = force1 * (center1 * sin_phi + center3 * cos_phi) - force3 * (center1 * cos_phi - center3 * sin_phi);
  for (int i = 0; i <= ball.mass_count; ++i) {
    const DiskMass& m = all[static_cast<std::size_t>(i)];
    const Real d1 = m.zeta1 - center1, d3 = m.zeta3 - center3;
    inertia += m.mass * (d1 * d1 + d3 * d3);
    torque -= m.mass * (d1 * m.p - d3 * m.q);
  }

  const Real spin_rate = torque / inertia;
  const Real along1 = -spin_rate * mass_zeta3 + mass_q;
  const Real along3 = spin_rate * mass_zeta1 + mass_p;
  DetachedDiskMotion out;
  out.angular_acceleration_radps2 = spin_rate;
  out.acceleration_W_mps2 = Vector3((force1 - (cos_phi * along1 - sin_phi * along3)) / mass, 0,
                                    (force3 - (sin_phi * along1 + cos_phi * along3)) / mass - ball.gravity_mps2);
  return out;
}

}  // namespace ballast::closed_forms
