#include "firmware/governor/held_ball.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "firmware/governor/turning.h"
#include "firmware/model/ball_sums.h"

namespace ballast::firmware {

using detail::Attitude;
using detail::cross;
using detail::dot;
using detail::from;
using detail::Sums;
using detail::Vec;

namespace {

// Bounds of the eigenvalues of a symmetric, positive definite matrix.
struct Spread {
  Real least, most;
};

// Roots of l^3 - t l^2 + s l - d by Newton's method from outside: all are real, so it never passes the nearest one, and
// where it stops it is a bound. It at least halves the distance to a triple root every three steps.
Spread spread(const Matrix3& m) {
  constexpr int kSteps = 40;
  const Real t = m(0, 0) + m(1, 1) + m(2, 2);
  const Real s = m(0, 0) * m(1, 1) - m(0, 1) * m(0, 1) + m(0, 0) * m(2, 2) - m(0, 2) * m(0, 2) + m(1, 1) * m(2, 2) -
                 m(1, 2) * m(1, 2);
  const Real d = m(0, 0) * (m(1, 1) * m(2, 2) - m(1, 2) * m(1, 2)) - m(0, 1) * (m(0, 1) * m(2, 2) - m(1, 2) * m(0, 2)) +
                 m(0, 2) * (m(0, 1) * m(1, 2) - m(1, 1) * m(0, 2));
  const auto root = [&](Real l) {
    for (int k = 0; k < kSteps; ++k) {
      const Real slope = (3 * l - 2 * t) * l + s;
      if (!(slope > 0)) break;
      l -= (((l - t) * l + s) * l - d) / slope;
    }
    return l;
  };
  return {root(0), root(t)};
}

Real length(const Vector3& v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

// Inertia about the centre of mass, body frame.
Matrix3 central_inertia(const BallParams& ball, const HeldBall& held) {
  const Matrix3& s = held.second_B_kgm2;
  const Vector3 c = held.moment_B_kgm / held.mass_kg;
  const Real square = c[0] * c[0] + c[1] * c[1] + c[2] * c[2], trace = s(0, 0) + s(1, 1) + s(2, 2);
  Matrix3 out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      out(i, j) = -s(i, j) + held.mass_kg * c[i] * c[j];
    }
    out(i, i) += ball.inertia_kgm2[i] + trace - held.mass_kg * square;
  }
  return out;
}

}  // namespace

HeldBall hold_masses(const BallParams& ball, const PerMass<Real>& mass_position) {
  HeldBall held;
  const auto add = [&](Real m, const Vector3& zeta) {
    held.mass_kg += m;
    for (int i = 0; i < 3; ++i) {
      held.moment_B_kgm[i] += m * zeta[i];
      for (int j = 0; j < 3; ++j) held.second_B_kgm2(i, j) += m * zeta[i] * zeta[j];
    }
  };
  add(ball.shell_mass_kg, ball.center_of_mass_B_m);
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    add(ball.mass_kg[i], evaluate<Real>(ball.rail[i], mass_position[i]).position);
  }
  return held;
}

RollingForces held_forces(const BallParams& ball, const HeldBall& held, const Quaternion& orientation,
                          const Vector3& angular_velocity_B_radps) {
  const Attitude lambda(orientation);
  const Vec omega = from(angular_velocity_B_radps), b = from(held.moment_B_kgm);
  const Vec r_gamma = ball.radius_m * lambda.gamma;
  const Matrix3& s = held.second_B_kgm2;
  // With p_i = r Gamma + zeta_i and c_i = Omega x (Omega x zeta_i): zeta_i x c_i = (Omega . zeta_i) zeta_i x Omega.
  Sums sums;
  sums.mass = held.mass_kg;
  sums.mass_p = held.mass_kg * r_gamma + b;
  sums.mass_c = cross(omega, cross(omega, b));
  const Vec along = {s(0, 0) * omega.x + s(0, 1) * omega.y + s(0, 2) * omega.z,
                     s(0, 1) * omega.x + s(1, 1) * omega.y + s(1, 2) * omega.z,
                     s(0, 2) * omega.x + s(1, 2) * omega.y + s(2, 2) * omega.z};
  sums.torque =
      cross(sums.mass_p, detail::against_weight(ball, lambda)) + cross(r_gamma, sums.mass_c) + cross(along, omega);
  // sum m_i p_i p_i^T = r Gamma (M r Gamma + b)^T + b (r Gamma)^T + sum m_i zeta_i zeta_i^T.
  const Vec& p = sums.mass_p;
  sums.xx = r_gamma.x * p.x + b.x * r_gamma.x + s(0, 0);
  sums.yy = r_gamma.y * p.y + b.y * r_gamma.y + s(1, 1);
  sums.zz = r_gamma.z * p.z + b.z * r_gamma.z + s(2, 2);
  sums.xy = r_gamma.x * p.y + b.x * r_gamma.y + s(0, 1);
  sums.xz = r_gamma.x * p.z + b.x * r_gamma.z + s(0, 2);
  sums.yz = r_gamma.y * p.z + b.y * r_gamma.z + s(1, 2);
  return detail::forces_of(ball, lambda, omega, sums);
}

ForEver held_for_ever(const BallParams& ball, const HeldBall& held, const Quaternion& orientation,
                      const Vector3& angular_velocity_B_radps, const HeldErrors& errors) {
  ForEver out;
  const Vector3& force = ball.external_force_W_n;
  const bool resists = ball.rolling_resistance > 0 || ball.spin_friction_m > 0;
  if (ball.down_W[0] != 0 || ball.down_W[1] != 0 || force[0] != 0 || force[1] != 0 || force[2] != 0 || resists) {
    return out;
  }
  const Real mass = held.mass_kg, g = ball.gravity_mps2;
  const Vector3 c = held.moment_B_kgm / mass;
  const Matrix3 inertia = central_inertia(ball, held);
  const Spread believed = spread(inertia);
  if (!(believed.least > 0)) return out;
  // The true ball's are between these.
  const Real part = errors.mass_share;
  const Spread of_inertia = {(believed.least - errors.turns_kgm2) * (1 - part),
                             (believed.most + errors.turns_kgm2) * (1 + part)};
  if (!(of_inertia.least > 0)) return out;
  const Real offset = length(c) + errors.off_center_m;

  // Energy above rest, with the centre of mass below the geometric centre.
  const Attitude lambda(orientation);
  const Vec omega = from(angular_velocity_B_radps);
  const Vec turned = {inertia(0, 0) * omega.x + inertia(0, 1) * omega.y + inertia(0, 2) * omega.z,
                      inertia(1, 0) * omega.x + inertia(1, 1) * omega.y + inertia(1, 2) * omega.z,
                      inertia(2, 0) * omega.x + inertia(2, 1) * omega.y + inertia(2, 2) * omega.z};
  const Vec speed = cross(omega, ball.radius_m * lambda.gamma + from(c));
  const Real height = dot(lambda.gamma, from(c));
  // Twice the kinetic energy, in whose norm the errors of the angular velocity add up.
  const Real twice = dot(omega, turned) + mass * dot(speed, speed);
  const Real reach = ball.radius_m + offset;
  const Real faster = std::sqrt(twice) + std::sqrt(of_inertia.most + mass * reach * reach) * errors.omega_radps +
                      std::sqrt(mass * dot(omega, omega)) * (errors.off_center_m + length(c) * errors.tilt_rad) +
                      std::sqrt((of_inertia.most - of_inertia.least) * dot(omega, omega)) * errors.tilt_rad;
  const Real higher = std::fmin(height + offset * errors.tilt_rad + errors.off_center_m, offset);
  // Its masses are heavier by at most `part`.
  const Real energy = errors.any() ? (1 + part) * (faster * faster / 2 + mass * g * (higher + offset))
                                   : twice / 2 + mass * g * (height + offset);

  // |a| <= p omega^2 + q sin(alpha), alpha the angle of c from the vertical, and omega^2 <= 2 (energy - M g |c| (1 -
  // cos alpha)) / least. With errors each of these has the value for which it is greatest.
  const Real least = of_inertia.least, arm = std::fmax(ball.radius_m - offset, Real(0));
  const Real light = mass * (1 - part), heavy = mass * (1 + part);
  const Real p = (of_inertia.most - of_inertia.least) / (2 * std::sqrt(light * least)) + 2 * offset;
  const Real q = g * offset * std::sqrt(heavy / (least + heavy * arm * arm));
  const Real low = std::fmax(length(c) - errors.off_center_m, Real(0));
  const Real fall = 2 * p * light * g * low / least;
  // Greatest q sin(alpha) - fall (1 - cos(alpha)): at tan(alpha) = q / fall, or where the energy ends before that.
  const Real hypotenuse = std::sqrt(q * q + fall * fall);
  const Real best = hypotenuse > 0 ? 1 - fall / hypotenuse : 0;  // 1 - cos(alpha) there
  const Real most = low > 0 ? std::fmin(energy / (light * g * low), Real(2)) : offset > 0 ? 2 : 0;
  const Real y = std::fmax(std::fmin(best, most), Real(0));
  out.acceleration_mps2 = 2 * p * energy / least + q * std::sqrt(y * (2 - y)) - fall * y;
  out.known = true;
  return out;
}

Real greatest_use(const BallParams& ball, Real mass_kg, Real acceleration_mps2, Real friction,
                  Real min_normal_force_n) {
  const Real g = ball.gravity_mps2, a = acceleration_mps2;
  if (!(mass_kg * (g - a) > min_normal_force_n)) return std::numeric_limits<Real>::infinity();
  // f_s / N = a cos(b) / (g - a sin(b)) is greatest at sin(b) = a / g.
  return a / (friction * std::sqrt((g - a) * (g + a)));
}

void step_held(const BallParams& ball, const HeldBall& held, const RollingForces& start, Real h_s, RobotState& state) {
  const Quaternion q0 = state.orientation;
  const Vector3 omega0 = state.angular_velocity_B_radps;
  TurningRate sum, rate = turning_rate(q0, omega0, start.angular_acceleration_B_radps2, ball.radius_m);
  sum.add(rate, h_s / 6);
  for (int stage = 1; stage < 4; ++stage) {
    const Real h = stage < 3 ? h_s / 2 : h_s;
    const Quaternion q = turned(q0, rate.orientation, h);
    const Vector3 omega = omega0 + h * rate.angular_velocity;
    rate = turning_rate(q, omega, held_forces(ball, held, q, omega).angular_acceleration_B_radps2, ball.radius_m);
    sum.add(rate, stage < 3 ? h_s / 3 : h_s / 6);
  }
  apply(sum, state);
}

}  // namespace ballast::firmware
