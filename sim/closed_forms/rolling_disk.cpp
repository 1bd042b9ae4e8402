#include "sim/closed_forms/rolling_disk.h"

#include <cmath>

#include "sim/closed_forms/disk_mass.h"

namespace ballast::closed_forms {

using firmware::sin_cos;

Quaternion orientation_of(const DiskState& disk) {
  const firmware::SinCos<Real> half = sin_cos(disk.angle_rad / 2);
  return Quaternion(half.cos, 0, -half.sin, 0);
}

Vector3 angular_velocity_of(const DiskState& disk) { return Vector3(0, -disk.angular_velocity_radps, 0); }

RollingDiskForces rolling_disk_forces(const BallParams& ball, const DiskState& disk, const MassMotion& masses) {
  const auto [sin_phi, cos_phi] = sin_cos(disk.angle_rad);
  const Real spin = disk.angular_velocity_radps;
  const Real r = ball.radius_m, g = ball.gravity_mps2;
  const Real force1 = ball.external_force_W_n[0], force3 = ball.external_force_W_n[2];

  // phiddot enters N and f_s linearly, so one pass over the masses gathers the sums of all three.
  Real mass = 0, mass_k = 0, inertia = ball.inertia_kgm2[1];
  Real mass_zeta1 = 0, mass_zeta3 = 0, mass_q = 0, mass_p = 0;
  for (int i = -1; i < ball.mass_count; ++i) {
    const DiskMass m = disk_mass(ball, disk, masses, i);
    const Real s1 = r * sin_phi + m.zeta1, s3 = r * cos_phi + m.zeta3;
    const Real k = (g + r * spin * spin) * (m.zeta3 * sin_phi - m.zeta1 * cos_phi) + s3 * m.e1 - s1 * m.e3;  // eq_K_i
    mass += m.mass;
    mass_k += m.mass * k;
    inertia += m.mass * (s1 * s1 + s3 * s3);
    mass_zeta1 += m.mass * m.zeta1;
    mass_zeta3 += m.mass * m.zeta3;
    mass_q += m.mass * m.q;
    mass_p += m.mass * m.p;
  }

  const Real spin_rate = (mass_k - r * force1) / inertia;
  const Real along1 = -spin_rate * mass_zeta3 + mass_q;
  const Real along3 = spin_rate * mass_zeta1 + mass_p;
  RollingDiskForces out;
  out.angular_acceleration_radps2 = spin_rate;
  out.normal_force_n = mass * g + along1 * sin_phi + along3 * cos_phi - force3;
  out.friction_force_W1_n = -(mass * r * spin_rate - along1 * cos_phi + along3 * sin_phi + force1);
  out.static_friction_n = std::abs(out.friction_force_W1_n);
  return out;
}

}  // namespace ballast::closed_forms
