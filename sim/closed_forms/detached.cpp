#include "sim/closed_forms/detached.h"

#include <array>
#include <cmath>

#include "sim/closed_forms/disk_mass.h"

namespace ballast::closed_forms {

using firmware::kMaxMasses;
using firmware::sin_cos;
using firmware::detail::Attitude;
using firmware::detail::AttitudeOf;
using firmware::detail::from;
using firmware::detail::SumsOf;
using firmware::detail::Vec;
using firmware::detail::VecOf;

namespace {

template <class T>
struct Detached {
  VecOf<T> omega_dot, acceleration_W;
};

template <class T>
Detached<T> detached(const BallParams& ball, const AttitudeOf<T>& lambda, const VecOf<T>& omega,
                     const MassTrajectoriesOf<T>& masses) {
  const Vec inertia = from(ball.inertia_kgm2);
  const Vec chi0 = from(ball.center_of_mass_B_m);
  const Vec force_W = from(ball.external_force_W_n);

  Real mass = ball.shell_mass_kg;
  const Vec shell = ball.shell_mass_kg * chi0;
  VecOf<T> mass_chi{shell.x, shell.y, shell.z};
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    mass += ball.mass_kg[k];
    mass_chi = mass_chi + ball.mass_kg[k] * from(masses.position_B_m[k]);
  }
  const VecOf<T> center = (1 / mass) * mass_chi;  // X

  // Levers d_i = chi_i - X. Gravity has no torque about X.
  const SumsOf<T> sums = sums_of(ball, omega, masses, Real(-1) * center, {0, 0, 0});
  const VecOf<T> omega_dot =
      sums.solve(inertia, gyroscopic(inertia, omega) + cross(center, lambda.to_B(force_W)) + sums.torque);

  // eq_ddot_z_GC.
  const VecOf<T> inertial = cross(omega_dot, center) + (1 / mass) * sums.mass_c;
  const Vec weight_W = ball.gravity_mps2 * from(ball.down_W);  // per mass
  return {omega_dot,
          {force_W.x / mass + weight_W.x - dot(lambda.row1, inertial),
           force_W.y / mass + weight_W.y - dot(lambda.row2, inertial),
           force_W.z / mass + weight_W.z - dot(lambda.gamma, inertial)}};
}

Vector3 change(const VecOf<Complex>& v) { return Vector3(v.x.imag(), v.y.imag(), v.z.imag()) / kComplexStep; }

}  // namespace

DetachedMotion detached_motion_3d(const BallParams& ball, const Quaternion& orientation,
                                  const Vector3& angular_velocity_B_radps, const MassTrajectories& masses) {
  const auto now = detached(ball, Attitude(orientation), from(angular_velocity_B_radps), masses);
  return {Vector3(now.omega_dot.x, now.omega_dot.y, now.omega_dot.z),
          Vector3(now.acceleration_W.x, now.acceleration_W.y, now.acceleration_W.z)};
}

DetachedMotion detached_motion(const BallParams& ball, const Quaternion& orientation,
                               const Vector3& angular_velocity_B_radps, const MassMotion& masses) {
  return detached_motion_3d(ball, orientation, angular_velocity_B_radps, along_rails(ball, masses));
}

Derivative<DetachedMotion> detached_motion_derivative(const BallParams& ball, const Quaternion& orientation,
                                                      const Vector3& angular_velocity_B_radps,
                                                      const MassMotion& masses) {
  return differentiate<DetachedMotion>(6, masses, ball.mass_count, [&](int column, const ComplexMotion& moved) {
    Eigen::Quaternion<Complex> q = orientation.cast<Complex>();
    std::array<Complex, 3> omega{angular_velocity_B_radps[0], angular_velocity_B_radps[1], angular_velocity_B_radps[2]};
    if (column >= 0 && column < 3) {
      // q (1, phi / 2) with an imaginary phi.
      Quaternion half(0, 0, 0, 0);
      half.vec()[column] = kComplexStep / 2;
      const Quaternion turn = orientation * half;
      q.coeffs() += Complex(0, 1) * turn.coeffs().cast<Complex>();
    } else if (column >= 3) {
      omega[static_cast<std::size_t>(column - 3)] += Complex(0, kComplexStep);
    }
    const auto now = detached(ball, AttitudeOf<Complex>(q), VecOf<Complex>{omega[0], omega[1], omega[2]},
                              along_rails_of<Complex>(ball, moved));
    return DetachedMotion{change(now.omega_dot), change(now.acceleration_W)};
  });
}

namespace {

template <class T>
struct DetachedDisk {
  T spin_rate, acceleration1, acceleration3;
};

template <class T, class Motion>
DetachedDisk<T> detached_disk(const BallParams& ball, const T& angle, const T& spin, const Motion& masses) {
  const firmware::SinCos<T> phi = sin_cos(angle);
  const T &sin_phi = phi.sin, &cos_phi = phi.cos;
  const Real force1 = ball.external_force_W_n[0], force3 = ball.external_force_W_n[2];

  std::array<DiskMass<T>, kMaxMasses + 1> all;
  Real mass = 0;
  T mass_zeta1 = 0, mass_zeta3 = 0, mass_q = 0, mass_p = 0;
  for (int i = -1; i < ball.mass_count; ++i) {
    const DiskMass<T> m = disk_mass(ball, spin, masses, i);
    all[static_cast<std::size_t>(i + 1)] = m;
    mass += m.mass;
    mass_zeta1 += m.mass * m.zeta1;
    mass_zeta3 += m.mass * m.zeta3;
    mass_q += m.mass * m.q;
    mass_p += m.mass * m.p;
  }
  const T center1 = mass_zeta1 / mass, center3 = mass_zeta3 / mass;  // X

  T inertia = ball.inertia_kgm2[1];
  T torque = force1 * (center1 * sin_phi + center3 * cos_phi) - force3 * (center1 * cos_phi - center3 * sin_phi);
  for (int i = 0; i <= ball.mass_count; ++i) {
    const DiskMass<T>& m = all[static_cast<std::size_t>(i)];
    const T d1 = m.zeta1 - center1, d3 = m.zeta3 - center3;
    inertia += m.mass * (d1 * d1 + d3 * d3);
    torque -= m.mass * (d1 * m.p - d3 * m.q);
  }

  const T spin_rate = torque / inertia;
  const T along1 = -spin_rate * mass_zeta3 + mass_q;
  const T along3 = spin_rate * mass_zeta1 + mass_p;
  return {spin_rate, (force1 - (cos_phi * along1 - sin_phi * along3)) / mass,
          (force3 - (sin_phi * along1 + cos_phi * along3)) / mass - ball.gravity_mps2};
}

}  // namespace

DetachedDiskMotion detached_disk_motion(const BallParams& ball, const DiskState& disk, const MassMotion& masses) {
  const auto now = detached_disk<Real>(ball, disk.angle_rad, disk.angular_velocity_radps, masses);
  return {now.spin_rate, Vector3(now.acceleration1, 0, now.acceleration3)};
}

Derivative<DetachedDiskMotion> detached_disk_motion_derivative(const BallParams& ball, const DiskState& disk,
                                                               const MassMotion& masses) {
  return differentiate<DetachedDiskMotion>(2, masses, ball.mass_count, [&](int column, const ComplexMotion& moved) {
    const Complex angle(disk.angle_rad, column == 0 ? kComplexStep : 0);
    const Complex spin(disk.angular_velocity_radps, column == 1 ? kComplexStep : 0);
    const auto now = detached_disk(ball, angle, spin, moved);
    return DetachedDiskMotion{now.spin_rate.imag() / kComplexStep,
                              Vector3(now.acceleration1.imag(), 0, now.acceleration3.imag()) / kComplexStep};
  });
}

}  // namespace ballast::closed_forms
