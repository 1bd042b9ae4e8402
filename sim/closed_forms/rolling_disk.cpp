#include "sim/closed_forms/rolling_disk.h"

#include <cmath>
#include <limits>

#include "sim/closed_forms/disk_mass.h"

namespace ballast::closed_forms {

using firmware::sin_cos;

Quaternion orientation_of(const DiskState& disk) {
  const firmware::SinCos<Real> half = sin_cos(disk.angle_rad / 2);
  return Quaternion(half.cos, 0, -half.sin, 0);
}

Vector3 angular_velocity_of(const DiskState& disk) { return Vector3(0, -disk.angular_velocity_radps, 0); }

namespace {

template <class T>
struct Rolling {
  T spin_rate, normal, friction1;
};

template <class T, class Motion>
Rolling<T> rolling(const BallParams& ball, const T& angle, const T& spin, const Motion& masses) {
  const firmware::SinCos<T> phi = sin_cos(angle);
  const T &sin_phi = phi.sin, &cos_phi = phi.cos;
  const Real r = ball.radius_m, g = ball.gravity_mps2;
  const Real force1 = ball.external_force_W_n[0], force3 = ball.external_force_W_n[2];

  // phiddot enters N and f_s linearly, so one pass over the masses gathers the sums of all three.
  Real mass = 0;
  T mass_k = 0, inertia = ball.inertia_kgm2[1];
  T mass_zeta1 = 0, mass_zeta3 = 0, mass_q = 0, mass_p = 0;
  for (int i = -1; i < ball.mass_count; ++i) {
    const DiskMass<T> m = disk_mass(ball, spin, masses, i);
    const T s1 = r * sin_phi + m.zeta1, s3 = r * cos_phi + m.zeta3;
    const T k = (g + r * spin * spin) * (m.zeta3 * sin_phi - m.zeta1 * cos_phi) + s3 * m.e1 - s1 * m.e3;  // eq_K_i
    mass += m.mass;
    mass_k += m.mass * k;
    inertia += m.mass * (s1 * s1 + s3 * s3);
    mass_zeta1 += m.mass * m.zeta1;
    mass_zeta3 += m.mass * m.zeta3;
    mass_q += m.mass * m.q;
    mass_p += m.mass * m.p;
  }

  const T spin_rate = (mass_k - r * force1) / inertia;
  const T along1 = -spin_rate * mass_zeta3 + mass_q;
  const T along3 = spin_rate * mass_zeta1 + mass_p;
  return {spin_rate, mass * g + along1 * sin_phi + along3 * cos_phi - force3,
          -(mass * r * spin_rate - along1 * cos_phi + along3 * sin_phi + force1)};
}

}  // namespace

RollingDiskForces rolling_disk_forces(const BallParams& ball, const DiskState& disk, const MassMotion& masses) {
  const auto now = rolling<Real>(ball, disk.angle_rad, disk.angular_velocity_radps, masses);
  return {now.spin_rate, now.normal, now.friction1, std::abs(now.friction1)};
}

Derivative<RollingDiskForces> rolling_disk_forces_derivative(const BallParams& ball, const DiskState& disk,
                                                             const MassMotion& masses) {
  return differentiate<RollingDiskForces>(2, masses, ball.mass_count, [&](int column, const ComplexMotion& moved) {
    const Complex angle(disk.angle_rad, column == 0 ? kComplexStep : 0);
    const Complex spin(disk.angular_velocity_radps, column == 1 ? kComplexStep : 0);
    const auto now = rolling(ball, angle, spin, moved);
    const Real along1 = now.friction1.real(), change1 = now.friction1.imag() / kComplexStep;
    const Real sign = along1 > 0 ? 1 : along1 < 0 ? -1 : std::numeric_limits<Real>::quiet_NaN();
    return RollingDiskForces{now.spin_rate.imag() / kComplexStep, now.normal.imag() / kComplexStep, change1,
                             sign * change1};
  });
}

}  // namespace ballast::closed_forms
