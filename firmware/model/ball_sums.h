// Parts that the ball's closed forms share: the rows of the attitude, and the sums over the masses.
#pragma once

#include <cmath>

#include "firmware/model/ball.h"

namespace ballast::firmware::detail {

// Vectors of plain scalars. The sums below run in every tick, and temporaries of a matrix library would double their
// cost.
struct Vec {
  Real x, y, z;
};

inline Vec operator+(const Vec& a, const Vec& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(Real k, const Vec& a) { return {k * a.x, k * a.y, k * a.z}; }
inline Vec cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Real dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec from(const Vector3& v) { return {v[0], v[1], v[2]}; }

// Rows of Lambda; the third is Gamma = Lambda^T e3.
struct Attitude {
  explicit Attitude(const Quaternion& q) {
    const Real w = q.w(), x = q.x(), y = q.y(), z = q.z();
    row1 = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)};
    row2 = {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)};
    gamma = {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)};
  }

  Vec to_B(const Vec& v_W) const { return v_W.x * row1 + v_W.y * row2 + v_W.z * gamma; }

  Vec row1, row2, gamma;
};

// Sums over the masses i = 0..n, each with a lever p_i and an acceleration c_i; u is the same for all.
struct Sums {
  Real mass = 0;                                        // M
  Vec mass_p{0, 0, 0};                                  // sum m_i p_i
  Vec mass_c{0, 0, 0};                                  // sum m_i c_i
  Vec torque{0, 0, 0};                                  // sum m_i p_i x (u + c_i)
  Real xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0;  // sum m_i p_i p_i^T

  [[gnu::always_inline]] void add(Real m, const Vec& p, const Vec& c, const Vec& u) {
    const Vec mp = m * p;
    mass += m;
    mass_p = mass_p + mp;
    mass_c = mass_c + m * c;
    torque = torque + cross(mp, u + c);
    xx += mp.x * p.x;
    yy += mp.y * p.y;
    zz += mp.z * p.z;
    xy += mp.x * p.y;
    xz += mp.x * p.z;
    yz += mp.y * p.z;
  }

  // [sum m_i p_i^2 - I]^-1 b.
  [[gnu::always_inline]] Vec solve(const Vec& inertia, const Vec& b) const;
};

// [sum m_i p_i^2 - I]^-1 with p^2, the squared cross-product matrix, = p p^T - |p|^2: symmetric, negative definite,
// inverted by its adjugate.
struct SymmetricInverse {
  [[gnu::always_inline]] SymmetricInverse(const Sums& sums, const Vec& inertia) {
    const Real a11 = -sums.yy - sums.zz - inertia.x, a22 = -sums.xx - sums.zz - inertia.y,
               a33 = -sums.xx - sums.yy - inertia.z;
    const Real a12 = sums.xy, a13 = sums.xz, a23 = sums.yz;
    c11 = a22 * a33 - a23 * a23, c12 = a13 * a23 - a12 * a33, c13 = a12 * a23 - a13 * a22;
    c22 = a11 * a33 - a13 * a13, c23 = a12 * a13 - a11 * a23, c33 = a11 * a22 - a12 * a12;
    per_det = 1 / (a11 * c11 + a12 * c12 + a13 * c13);
  }
  [[gnu::always_inline]] Vec times(const Vec& b) const {
    return {per_det * (c11 * b.x + c12 * b.y + c13 * b.z), per_det * (c12 * b.x + c22 * b.y + c23 * b.z),
            per_det * (c13 * b.x + c23 * b.y + c33 * b.z)};
  }

  Real c11, c12, c13, c22, c23, c33, per_det;
};

inline Vec Sums::solve(const Vec& inertia, const Vec& b) const { return SymmetricInverse(*this, inertia).times(b); }

// Omega x I Omega.
inline Vec gyroscopic(const Vec& inertia, const Vec& omega) {
  return cross(omega, {inertia.x * omega.x, inertia.y * omega.y, inertia.z * omega.z});
}

// -Lambda^T g_W: g Gamma on a level floor.
[[gnu::always_inline]] inline Vec against_weight(const BallParams& ball, const Attitude& lambda) {
  const Vector3& down = ball.down_W;
  if (down[0] == 0 && down[1] == 0) [[likely]] {
    return ball.gravity_mps2 * lambda.gamma;
  }
  return (-ball.gravity_mps2) * lambda.to_B(from(down));
}

// T_W / N, the floor's moment for a unit of N, of a ball with this angular velocity in the space frame.
inline Vec moment_arm_W(const BallParams& ball, const Vec& omega_W) {
  const Real creep2 = ball.creep_radps * ball.creep_radps;
  const Real rolling =
      ball.rolling_resistance * ball.radius_m / std::sqrt(omega_W.x * omega_W.x + omega_W.y * omega_W.y + creep2);
  const Real spinning = ball.spin_friction_m / std::sqrt(omega_W.z * omega_W.z + creep2);
  return {-rolling * omega_W.x, -rolling * omega_W.y, -spinning * omega_W.z};
}

// eq_Om, eq_normal and eq_static_friction, and their 1-d forms, on any floor (rolling.h). They differ in the sums only,
// which have the levers s_i and u = against_weight().
RollingForces forces_of(const BallParams& ball, const Attitude& lambda, const Vec& omega, const Sums& sums);

}  // namespace ballast::firmware::detail
