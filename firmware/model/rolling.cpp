#include "firmware/model/rolling.h"

namespace ballast::firmware {

namespace {

// Plain scalars: the sums below run in every tick, and temporaries of a matrix library would double their cost.
struct Vec {
  Real x, y, z;
};

Vec operator+(const Vec& a, const Vec& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator*(Real k, const Vec& a) { return {k * a.x, k * a.y, k * a.z}; }
Vec cross(const Vec& a, const Vec& b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
Real dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec from(const Vector3& v) { return {v[0], v[1], v[2]}; }

// The sums over i = 0..n of eq_Om_1d, eq_normal_1d and eq_static_friction_1d.
struct Sums {
  Real mass = 0;                                        // M
  Vec mass_s{0, 0, 0};                                  // sum m_i s_i
  Vec mass_c{0, 0, 0};                                  // sum m_i c_i
  Vec torque{0, 0, 0};                                  // sum m_i s_i x (g Gamma + c_i)
  Real xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0;  // sum m_i s_i s_i^T

  void add(Real m, const Vec& s, const Vec& c, const Vec& g_gamma) {
    const Vec ms = m * s;
    mass += m;
    mass_s = mass_s + ms;
    mass_c = mass_c + m * c;
    torque = torque + cross(ms, g_gamma + c);
    xx += ms.x * s.x;
    yy += ms.y * s.y;
    zz += ms.z * s.z;
    xy += ms.x * s.y;
    xz += ms.x * s.z;
    yz += ms.y * s.z;
  }
};

}  // namespace

RollingForces rolling_forces(const BallParams& ball, const Quaternion& orientation,
                             const Vector3& angular_velocity_B_radps, const MassMotion& masses) {
  const Real w = orientation.w(), x = orientation.x(), y = orientation.y(), z = orientation.z();
  // Rows of Lambda; the third is Gamma = Lambda^T e3.
  const Vec row1{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)};
  const Vec row2{2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)};
  const Vec gamma{2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};

  const Real r = ball.radius_m;
  const Vec r_gamma = r * gamma;
  const Vec g_gamma = ball.gravity_mps2 * gamma;
  const Vec omega = from(angular_velocity_B_radps);
  const Vec force_W = from(ball.external_force_W_n);
  const Vec force_B = force_W.x * row1 + force_W.y * row2 + force_W.z * gamma;  // Gamma~ = Lambda^-1 F_e

  // c_i = Omega x (Omega x zeta_i + 2 theta_i' zeta_i') + theta_i'^2 zeta_i'' + theta_i'' zeta_i', s_i = r Gamma +
  // zeta_i.
  Sums sums;
  const Vec chi0 = from(ball.center_of_mass_B_m);
  sums.add(ball.shell_mass_kg, r_gamma + chi0, cross(omega, cross(omega, chi0)), g_gamma);
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const RailPoint<Real> rail = evaluate<Real>(ball.rail[k], masses.position[k]);
    const Real rate = masses.velocity[k];
    const Vec zeta = from(rail.position), d1 = from(rail.d1), d2 = from(rail.d2);
    const Vec c = cross(omega, cross(omega, zeta) + (2 * rate) * d1) + (rate * rate) * d2 + masses.acceleration[k] * d1;
    sums.add(ball.mass_kg[k], r_gamma + zeta, c, g_gamma);
  }

  // eq_Om_1d. s^2 (the squared cross-product matrix) is s s^T - |s|^2; A = sum m_i s_i^2 - I is symmetric, negative
  // definite.
  const Vec inertia = from(ball.inertia_kgm2);
  const Real a11 = -sums.yy - sums.zz - inertia.x, a22 = -sums.xx - sums.zz - inertia.y;
  const Real a33 = -sums.xx - sums.yy - inertia.z;
  const Real a12 = sums.xy, a13 = sums.xz, a23 = sums.yz;
  const Vec i_omega{inertia.x * omega.x, inertia.y * omega.y, inertia.z * omega.z};
  const Vec b = cross(omega, i_omega) + cross(r * force_B, gamma) + sums.torque;
  const Real c11 = a22 * a33 - a23 * a23, c12 = a13 * a23 - a12 * a33, c13 = a12 * a23 - a13 * a22;
  const Real c22 = a11 * a33 - a13 * a13, c23 = a12 * a13 - a11 * a23, c33 = a11 * a22 - a12 * a12;
  const Real per_det = 1 / (a11 * c11 + a12 * c12 + a13 * c13);
  const Vec omega_dot{per_det * (c11 * b.x + c12 * b.y + c13 * b.z), per_det * (c12 * b.x + c22 * b.y + c23 * b.z),
                      per_det * (c13 * b.x + c23 * b.y + c33 * b.z)};

  // eq_normal_1d and eq_static_friction_1d, sum m_i [Omegadot x s_i + c_i] once for both.
  const Vec inertial = cross(omega_dot, sums.mass_s) + sums.mass_c;
  RollingForces out;
  out.angular_acceleration_B_radps2 = Vector3(omega_dot.x, omega_dot.y, omega_dot.z);
  out.normal_force_n = sums.mass * ball.gravity_mps2 + dot(inertial, gamma) - force_W.z;
  out.friction_force_W_n = Vector2(dot(row1, inertial) - force_W.x, dot(row2, inertial) - force_W.y);
  // sqrt, not hypot: IEEE gives its bits on every platform.
  out.static_friction_n = std::sqrt(out.friction_force_W_n[0] * out.friction_force_W_n[0] +
                                    out.friction_force_W_n[1] * out.friction_force_W_n[1]);
  return out;
}

}  // namespace ballast::firmware
