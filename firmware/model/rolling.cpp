#include "firmware/model/rolling.h"

#include <cmath>
#include <limits>

#include "firmware/model/ball_sums.h"

namespace ballast::firmware {

using detail::Attitude;
using detail::from;
using detail::Sums;
using detail::Vec;

namespace {

[[gnu::always_inline]] inline bool slopes(const BallParams& ball) { return ball.down_W[0] != 0 || ball.down_W[1] != 0; }

// Omegadot with the floor's moment; omega_dot_0 is without.
[[gnu::noinline, gnu::cold]] Vec resisted(const BallParams& ball, const Attitude& lambda, const Vec& omega,
                                          const Sums& sums, const Vec& omega_dot_0) {
  const Real pressing_n = -sums.mass * ball.gravity_mps2 * ball.down_W[2] - ball.external_force_W_n[2];
  const Real normal_0 = pressing_n + dot(cross(omega_dot_0, sums.mass_p) + sums.mass_c, lambda.gamma);
  if (!(normal_0 > 0)) return omega_dot_0;
  const detail::SymmetricInverse inverse(sums, from(ball.inertia_kgm2));
  const detail::Resistance floor = detail::resistance(ball, lambda, omega, sums, inverse);
  const Real normal = floor.share > 0 ? normal_0 / floor.share : std::numeric_limits<Real>::quiet_NaN();
  return omega_dot_0 + normal * floor.omega_dot_1;
}

// detail::forces_of(), inlined into the tick's own form.
[[gnu::always_inline]] inline RollingForces forces_from(const BallParams& ball, const Attitude& lambda,
                                                        const Vec& omega, const Sums& sums) {
  const Vec inertia = from(ball.inertia_kgm2);
  const Vec force_W = from(ball.external_force_W_n);
  const Vec force_B = lambda.to_B(force_W);  // Gamma~ = Lambda^-1 F_e
  const Vec b = gyroscopic(inertia, omega) + cross(ball.radius_m * force_B, lambda.gamma) + sums.torque;
  Vec omega_dot = sums.solve(inertia, b);
  if (detail::resists(ball)) [[unlikely]] {
    // Copies, so that on an ideal floor the originals stay in registers.
    omega_dot = resisted(ball, Attitude(lambda), Vec(omega), Sums(sums), Vec(omega_dot));
  }

  // sum m_i [Omegadot x s_i + c_i] once for N and for friction.
  const Vec inertial = cross(omega_dot, sums.mass_p) + sums.mass_c;
  RollingForces out;
  out.angular_acceleration_B_radps2 = Vector3(omega_dot.x, omega_dot.y, omega_dot.z);
  out.normal_force_n = sums.mass * ball.gravity_mps2 + dot(inertial, lambda.gamma) - force_W.z;
  out.friction_force_W_n = Vector2(dot(lambda.row1, inertial) - force_W.x, dot(lambda.row2, inertial) - force_W.y);
  if (slopes(ball)) [[unlikely]] {
    const Vec weight_W = (sums.mass * ball.gravity_mps2) * from(ball.down_W);
    out.normal_force_n = dot(inertial, lambda.gamma) - weight_W.z - force_W.z;
    out.friction_force_W_n -= Vector2(weight_W.x, weight_W.y);
  }
  // sqrt, not hypot: IEEE gives its bits on every platform.
  out.static_friction_n = std::sqrt(out.friction_force_W_n[0] * out.friction_force_W_n[0] +
                                    out.friction_force_W_n[1] * out.friction_force_W_n[1]);
  return out;
}

}  // namespace

RollingForces rolling_forces(const BallParams& ball, const Quaternion& orientation,
                             const Vector3& angular_velocity_B_radps, const MassMotion& masses) {
  const Attitude lambda(orientation);
  const Vec r_gamma = ball.radius_m * lambda.gamma;
  const Vec g_gamma = ball.gravity_mps2 * lambda.gamma;
  const Vec omega = from(angular_velocity_B_radps);

  // c_i = Omega x (Omega x zeta_i + 2 theta_i' zeta_i') + theta_i'^2 zeta_i'' + theta_i'' zeta_i', s_i = r Gamma +
  // zeta_i.
  const Vec u = slopes(ball) ? detail::against_weight(ball, lambda) : g_gamma;
  Sums sums;
  const Vec chi0 = from(ball.center_of_mass_B_m);
  sums.add(ball.shell_mass_kg, r_gamma + chi0, cross(omega, cross(omega, chi0)), u);
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const RailPoint<Real> rail = evaluate<Real>(ball.rail[k], masses.position[k]);
    const Real rate = masses.velocity[k];
    const Vec zeta = from(rail.position), d1 = from(rail.d1), d2 = from(rail.d2);
    const Vec c = cross(omega, cross(omega, zeta) + (2 * rate) * d1) + (rate * rate) * d2 + masses.acceleration[k] * d1;
    sums.add(ball.mass_kg[k], r_gamma + zeta, c, u);
  }
  return forces_from(ball, lambda, omega, sums);
}

RollingForces detail::forces_of(const BallParams& ball, const Attitude& lambda, const Vec& omega, const Sums& sums) {
  return forces_from(ball, lambda, omega, sums);
}

}  // namespace ballast::firmware
