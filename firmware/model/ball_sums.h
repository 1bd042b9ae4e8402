// Parts that the ball's closed forms share: the rows of the attitude, and the sums over the masses.
#pragma once

#include <cmath>

#include "firmware/model/ball.h"

namespace ballast::firmware::detail {

// Vectors of plain scalars. The sums below run in every tick, and temporaries of a matrix library would double their
// cost. The tick's scalar is Real; complex ones give derivatives by complex step.
template <class T>
struct VecOf {
  T x, y, z;
};
using Vec = VecOf<Real>;

template <class A, class B>
inline auto operator+(const VecOf<A>& a, const VecOf<B>& b) -> VecOf<decltype(a.x + b.x)> {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class A, class B>
inline auto operator-(const VecOf<A>& a, const VecOf<B>& b) -> VecOf<decltype(a.x - b.x)> {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
inline VecOf<T> operator*(Real k, const VecOf<T>& a) {
  return {k * a.x, k * a.y, k * a.z};
}
template <class A, class B>
inline auto cross(const VecOf<A>& a, const VecOf<B>& b) -> VecOf<decltype(a.x * b.x)> {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class A, class B>
inline auto dot(const VecOf<A>& a, const VecOf<B>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
inline VecOf<T> from(const Eigen::Matrix<T, 3, 1>& v) {
  return {v[0], v[1], v[2]};
}

// Rows of Lambda; the third is Gamma = Lambda^T e3.
template <class T>
struct AttitudeOf {
  explicit AttitudeOf(const Eigen::Quaternion<T>& q) {
    constexpr Real one = 1, two = 2;
    const T w = q.w(), x = q.x(), y = q.y(), z = q.z();
    row1 = {one - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)};
    row2 = {two * (x * y + w * z), one - two * (x * x + z * z), two * (y * z - w * x)};
    gamma = {two * (x * z - w * y), two * (y * z + w * x), one - two * (x * x + y * y)};
  }

  VecOf<T> to_B(const Vec& v_W) const { return v_W.x * row1 + v_W.y * row2 + v_W.z * gamma; }

  VecOf<T> row1, row2, gamma;
};
using Attitude = AttitudeOf<Real>;

// Sums over the masses i = 0..n, each with a lever p_i and an acceleration c_i; u is the same for all.
template <class T>
struct SumsOf {
  Real mass = 0;                                     // M
  VecOf<T> mass_p{0, 0, 0};                          // sum m_i p_i
  VecOf<T> mass_c{0, 0, 0};                          // sum m_i c_i
  VecOf<T> torque{0, 0, 0};                          // sum m_i p_i x (u + c_i)
  T xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0;  // sum m_i p_i p_i^T

  [[gnu::always_inline]] void add(Real m, const VecOf<T>& p, const VecOf<T>& c, const Vec& u) {
    const VecOf<T> mp = m * p;
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
  [[gnu::always_inline]] VecOf<T> solve(const Vec& inertia, const VecOf<T>& b) const;
};

// [sum m_i p_i^2 - I]^-1 with p^2, the squared cross-product matrix, = p p^T - |p|^2: symmetric, negative definite,
// inverted by its adjugate.
template <class T>
struct SymmetricInverseOf {
  [[gnu::always_inline]] SymmetricInverseOf(const SumsOf<T>& sums, const Vec& inertia) {
    const T a11 = -sums.yy - sums.zz - inertia.x, a22 = -sums.xx - sums.zz - inertia.y,
            a33 = -sums.xx - sums.yy - inertia.z;
    const T a12 = sums.xy, a13 = sums.xz, a23 = sums.yz;
    c11 = a22 * a33 - a23 * a23, c12 = a13 * a23 - a12 * a33, c13 = a12 * a23 - a13 * a22;
    c22 = a11 * a33 - a13 * a13, c23 = a12 * a13 - a11 * a23, c33 = a11 * a22 - a12 * a12;
    per_det = Real(1) / (a11 * c11 + a12 * c12 + a13 * c13);
  }
  [[gnu::always_inline]] VecOf<T> times(const VecOf<T>& b) const {
    return {per_det * (c11 * b.x + c12 * b.y + c13 * b.z), per_det * (c12 * b.x + c22 * b.y + c23 * b.z),
            per_det * (c13 * b.x + c23 * b.y + c33 * b.z)};
  }

  T c11, c12, c13, c22, c23, c33, per_det;
};
using Sums = SumsOf<Real>;
using SymmetricInverse = SymmetricInverseOf<Real>;

template <class T>
inline VecOf<T> SumsOf<T>::solve(const Vec& inertia, const VecOf<T>& b) const {
  return SymmetricInverseOf<T>(*this, inertia).times(b);
}

// Omega x I Omega.
template <class T>
inline VecOf<T> gyroscopic(const Vec& inertia, const VecOf<T>& omega) {
  return cross(omega, VecOf<T>{inertia.x * omega.x, inertia.y * omega.y, inertia.z * omega.z});
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

[[gnu::always_inline]] inline bool resists(const BallParams& ball) {
  return ball.rolling_resistance > 0 || ball.spin_friction_m > 0;
}

// A floor that resists: Omegadot grows by omega_dot_1 for each unit of N, and N is normal_0 / share of a floor that
// does not, where share > 0; otherwise no N balances the ball.
struct Resistance {
  Vec omega_dot_1{0, 0, 0};
  Real share = 1;
};
inline Resistance resistance(const BallParams& ball, const Attitude& lambda, const Vec& omega, const Sums& sums,
                             const SymmetricInverse& inverse) {
  Resistance out;
  const Vec omega_W = {dot(lambda.row1, omega), dot(lambda.row2, omega), dot(lambda.gamma, omega)};
  out.omega_dot_1 = inverse.times(Real(-1) * lambda.to_B(moment_arm_W(ball, omega_W)));
  out.share = 1 - dot(cross(out.omega_dot_1, sums.mass_p), lambda.gamma);
  return out;
}

// eq_Om, eq_normal and eq_static_friction, and their 1-d forms, on any floor (rolling.h). They differ in the sums only,
// which have the levers s_i and u = against_weight().
RollingForces forces_of(const BallParams& ball, const Attitude& lambda, const Vec& omega, const Sums& sums);

}  // namespace ballast::firmware::detail
