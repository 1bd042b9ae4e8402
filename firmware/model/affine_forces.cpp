#include "firmware/model/affine_forces.h"

#include <cmath>
#include <limits>

#include "firmware/model/ball_sums.h"

namespace ballast::firmware {

using detail::Attitude;
using detail::cross;
using detail::dot;
using detail::from;
using detail::Sums;
using detail::Vec;

namespace {

Vector3 vector(const Vec& v) { return {v.x, v.y, v.z}; }

}  // namespace

void affine_forces(const BallParams& ball, const Quaternion& orientation, const Vector3& angular_velocity_B_radps,
                   const MassMotion& masses, AffineForces& out) {
  const Attitude lambda(orientation);
  const Vec r_gamma = ball.radius_m * lambda.gamma;
  const Vec omega = from(angular_velocity_B_radps);
  const Vec against_weight = detail::against_weight(ball, lambda);
  const auto n = static_cast<std::size_t>(ball.mass_count);

  // As in rolling_forces(), with u = 0; beside it the part of each mass that u_i scales.
  Sums sums;
  const Vec chi0 = from(ball.center_of_mass_B_m);
  sums.add(ball.shell_mass_kg, r_gamma + chi0, cross(omega, cross(omega, chi0)), against_weight);
  PerMass<Vec> force_B;   // m_i zeta_i'
  PerMass<Vec> torque_B;  // m_i s_i x zeta_i'
  for (std::size_t i = 0; i < n; ++i) {
    const RailPoint<Real> rail = evaluate<Real>(ball.rail[i], masses.position[i]);
    const Real rate = masses.velocity[i];
    const Vec zeta = from(rail.position), d1 = from(rail.d1), d2 = from(rail.d2);
    const Vec s = r_gamma + zeta;
    const Vec c = cross(omega, cross(omega, zeta) + (2 * rate) * d1) + (rate * rate) * d2;
    sums.add(ball.mass_kg[i], s, c, against_weight);
    force_B[i] = ball.mass_kg[i] * d1;
    torque_B[i] = cross(s, force_B[i]);
  }

  const Vec inertia = from(ball.inertia_kgm2);
  const Vec outside_W = from(ball.external_force_W_n);
  const Vec moment_B =
      gyroscopic(inertia, omega) + cross(ball.radius_m * lambda.to_B(outside_W), lambda.gamma) + sums.torque;
  const detail::SymmetricInverse inverse(sums, inertia);
  detail::Resistance floor;
  if (detail::resists(ball)) floor = detail::resistance(ball, lambda, omega, sums, inverse);
  const Real normal_per_normal_0 = floor.share > 0 ? 1 / floor.share : std::numeric_limits<Real>::quiet_NaN();

  // Omegadot and force that belong to a moment and an inertial force: of u = 0 with the weight, of each u_i without.
  const auto answer = [&](const Vec& moment, const Vec& inertial_0, const Vec& weight_W, Vector3& omega_dot,
                          Vector3& force_W) {
    Vec turning = inverse.times(moment);
    Vec inertial = cross(turning, sums.mass_p) + inertial_0;
    const Real normal = normal_per_normal_0 * (dot(inertial, lambda.gamma) - weight_W.z);
    turning = turning + normal * floor.omega_dot_1;
    inertial = inertial + normal * cross(floor.omega_dot_1, sums.mass_p);
    omega_dot = vector(turning);
    force_W = Vector3(dot(lambda.row1, inertial) - weight_W.x, dot(lambda.row2, inertial) - weight_W.y, normal);
  };
  const Vec down_W = from(ball.down_W);
  answer(moment_B, sums.mass_c, (sums.mass * ball.gravity_mps2) * down_W + outside_W, out.omega_dot_B_radps2,
         out.force_W_n);
  for (std::size_t i = 0; i < n; ++i) {
    answer(torque_B[i], force_B[i], Vec{0, 0, 0}, out.omega_dot_per_unit[i], out.force_per_unit[i]);
  }
}

}  // namespace ballast::firmware
