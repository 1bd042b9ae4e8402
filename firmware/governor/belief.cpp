#include "firmware/governor/belief.h"

#include <cmath>

#include "firmware/model/ball_sums.h"

namespace ballast::firmware {

using detail::Attitude;
using detail::cross;
using detail::dot;
using detail::from;
using detail::Vec;

namespace {

Real length(const Vec& v) { return std::sqrt(dot(v, v)); }
Real length(const Horizontal& v) { return std::sqrt(v.x * v.x + v.y * v.y); }
Vector3 vector(const Vec& v) { return {v.x, v.y, v.z}; }

// From the middle of a cube whose half side is 1 to its corner.
constexpr Real kCorner = Real(1.7320508075688772);

}  // namespace

Arms arms_of(const BallParams& ball, const MassMotion& masses, const Vector3& angular_velocity_B_radps) {
  const auto n = static_cast<std::size_t>(ball.mass_count);
  Arms out;
  const Vec omega = from(angular_velocity_B_radps), chi0 = from(ball.center_of_mass_B_m);
  Vec moment = ball.shell_mass_kg * chi0;
  out.mass_kg = ball.shell_mass_kg;
  for (std::size_t i = 0; i < n; ++i) {
    const RailPoint<Real> rail = evaluate<Real>(ball.rail[i], masses.position[i]);
    const Real v = masses.velocity[i];
    const Vec d1 = from(rail.d1);
    out.arm_B_m[i] = rail.position;
    out.own_B_mps2[i] = vector((2 * v) * cross(omega, d1) + (v * v) * from(rail.d2) + masses.acceleration[i] * d1);
    out.mass_kg += ball.mass_kg[i];
    moment = moment + ball.mass_kg[i] * from(rail.position);
  }
  const Vec center = (1 / out.mass_kg) * moment;
  out.center_B_m = vector(center);
  out.shell_B_m = vector(chi0 - center);
  for (std::size_t i = 0; i < n; ++i) out.arm_B_m[i] = vector(from(out.arm_B_m[i]) - center);
  return out;
}

void drift_of(const BallParams& ball, const BeliefErrors& errors, const Arms& arms, const Quaternion& orientation,
              const Vector3& angular_velocity_B_radps, const RollingForces& forces, Drift& out) {
  const auto n = static_cast<std::size_t>(ball.mass_count);
  const Attitude lambda(orientation);
  const Vec gamma = lambda.gamma, center = from(arms.center_B_m);
  const Vec omega = from(angular_velocity_B_radps), turning = from(forces.angular_acceleration_B_radps2);
  const Vec against_weight = detail::against_weight(ball, lambda);
  const Real mass = arms.mass_kg, r = ball.radius_m;
  const Vec lever = r * gamma + center;  // from the contact point to the centre of mass
  // A point of the body that is `arm` from the centre of mass accelerates by this more: Omegadot x arm + Omega x
  // (Omega x arm), by the columns of that matrix.
  const Real square = dot(omega, omega);
  const std::array<Vec, 3> columns{
      Vec{omega.x * omega.x - square, omega.x * omega.y + turning.z, omega.x * omega.z - turning.y},
      Vec{omega.x * omega.y - turning.z, omega.y * omega.y - square, omega.y * omega.z + turning.x},
      Vec{omega.x * omega.z + turning.y, omega.y * omega.z - turning.x, omega.z * omega.z - square}};
  const auto turned = [&](const Vec& arm) { return arm.x * columns[0] + arm.y * columns[1] + arm.z * columns[2]; };
  Vec mean_own{0, 0, 0};
  for (std::size_t i = 0; i < n; ++i) mean_own = mean_own + (ball.mass_kg[i] / mass) * from(arms.own_B_mps2[i]);
  // The acceleration of the centre of mass, with the weight: the reaction of the floor per mass.
  const Vec felt = against_weight + cross(turning, lever) + cross(omega, cross(omega, center)) + mean_own;

  // The mean moment of inertia about the horizontal axes through the contact point.
  const Vector3& own = ball.inertia_kgm2;
  Real inertia =
      (own[0] * (1 - gamma.x * gamma.x) + own[1] * (1 - gamma.y * gamma.y) + own[2] * (1 - gamma.z * gamma.z)) / 2;
  const auto inertia_of = [&](const Vec& arm) {
    const Vec s = lever + arm;
    const Real up = dot(s, gamma);
    return (dot(s, s) + up * up) / 2;
  };
  inertia += ball.shell_mass_kg * inertia_of(from(arms.shell_B_m));
  for (std::size_t i = 0; i < n; ++i) inertia += ball.mass_kg[i] * inertia_of(from(arms.arm_B_m[i]));

  out.errors = kShellErrors + ball.mass_count;
  out.off_center_m = out.other_n = 0;
  const auto push = [&](int j, const Vec& moment) {
    const Real per = -1 / inertia;
    out.pushes_radps2[static_cast<std::size_t>(j)] = {per * dot(lambda.row1, moment), per * dot(lambda.row2, moment)};
  };
  const Vec shell = from(arms.shell_B_m), none{0, 0, 0};
  const Real center_kgm = errors.center_of_mass_m * ball.shell_mass_kg;
  const Vec shell_felt = felt + turned(shell) - mean_own;
  const std::array<Vec, 3> axes{Vec{1, 0, 0}, Vec{0, 1, 0}, Vec{0, 0, 1}};
  for (int k = 0; k < 3; ++k) {
    const Vec& more = columns[static_cast<std::size_t>(k)];
    push(k, center_kgm * (cross(axes[static_cast<std::size_t>(k)], shell_felt) + cross(lever + shell, more)));
    out.other_n += center_kgm * length(more);
    out.off_center_m += center_kgm / mass;
  }
  // The moment of inertia about axis k takes its axis along: I (Omegadot_k e_k + Omega_k Omega x e_k).
  const std::array<Real, 3> turns{turning.x, turning.y, turning.z}, rates{omega.x, omega.y, omega.z};
  Vec of_inertia{0, 0, 0};
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec moment = own[static_cast<int>(k)] * (turns[k] * axes[k] + rates[k] * cross(omega, axes[k]));
    push(kFirstInertiaError + static_cast<int>(k), errors.mass_share * moment);
    of_inertia = of_inertia + moment;
  }
  // A mass that is heavier is that, and all others lighter: masses that are all heavier by the same part roll as
  // before, but for the shell's inertia and an outside force, which are less beside them.
  const Vec outside_W = from(ball.external_force_W_n);
  Vec beside = of_inertia + cross(r * lambda.to_B(outside_W), gamma) + ball.shell_mass_kg * cross(shell, turned(shell));
  for (std::size_t i = 0; i < n; ++i) {
    const Vec arm = from(arms.arm_B_m[i]);
    beside = beside + ball.mass_kg[i] * cross(arm, turned(arm) + from(arms.own_B_mps2[i]));
  }
  const Real outside_n = length(outside_W);
  const auto add = [&](int j, Real error_kg, const Vec& arm, const Vec& own_mps2) {
    const Vec more = turned(arm) + own_mps2 - mean_own;
    push(j, error_kg * (cross(arm, felt) + cross(lever + arm, more) - (1 / mass) * beside));
    out.other_n += error_kg * (length(more) + outside_n / mass);
    out.off_center_m += error_kg * length(arm) / mass;
  };
  add(kShellMassError, errors.mass_share * ball.shell_mass_kg, shell, none);
  for (std::size_t i = 0; i < n; ++i) {
    add(kShellErrors + static_cast<int>(i), errors.mass_share * ball.mass_kg[i], from(arms.arm_B_m[i]),
        from(arms.own_B_mps2[i]));
  }

  const Real use = forces.normal_force_n > 0 ? forces.static_friction_n / forces.normal_force_n : 0;
  const Real steep = std::sqrt(1 + use * use), rate = length(omega), offset = length(center);
  out.spin_radps = dot(omega, gamma);
  out.rolling_radps = length(omega - out.spin_radps * gamma);
  out.resistance_n = 2 * ball.rolling_resistance * forces.normal_force_n;
  out.stiffness_per_s2 = mass * dot(center, against_weight) / inertia;
  out.other_n *= steep;
  out.per_angular_acceleration = steep * mass * length(lever);
  out.per_omega = steep * mass * 2 * rate * offset;
  out.per_tilt = steep * mass * (length(turning) + rate * rate) * offset;
}

Real Drift::force_n() const {
  Real sum = 0;
  for (std::size_t j = 0; j < static_cast<std::size_t>(errors); ++j) sum += length(pushes_radps2[j]);
  return other_n + per_angular_acceleration * sum;
}

void Astray::advance(const Drift& drift, Real h_s) {
  const Real k = drift.stiffness_per_s2, spin = h_s * drift.spin_radps;
  for (std::size_t j = 0; j < static_cast<std::size_t>(drift.errors); ++j) {
    Horizontal &e = tilt_[j], &v = omega_[j];
    v.x += h_s * (k * e.x + drift.pushes_radps2[j].x);
    v.y += h_s * (k * e.y + drift.pushes_radps2[j].y);
    e = {e.x + h_s * v.x - spin * e.y, e.y + h_s * v.y + spin * e.x};
  }
}

Real Astray::omega_radps(const Drift& drift) const {
  Real sum = 0;
  for (std::size_t j = 0; j < static_cast<std::size_t>(drift.errors); ++j) sum += length(omega_[j]);
  return sum;
}

Real Astray::tilt_rad(const Drift& drift) const {
  Real sum = 0;
  for (std::size_t j = 0; j < static_cast<std::size_t>(drift.errors); ++j) sum += length(tilt_[j]);
  return sum;
}

Real Astray::force_n(const Drift& drift) const {
  const Real k = drift.stiffness_per_s2;
  Real sum = 0, omega = 0, tilt = 0;
  for (std::size_t j = 0; j < static_cast<std::size_t>(drift.errors); ++j) {
    sum += length(drift.pushes_radps2[j]);
    omega += length(omega_[j]);
    tilt += length(tilt_[j]);
  }
  // The weight of a ball astray may balance the push. The tick does not know the push, and keeps all of it free.
  sum += std::fabs(k) * tilt;
  Real out = drift.other_n + drift.per_angular_acceleration * sum + drift.per_omega * omega + drift.per_tilt * tilt;
  if (drift.resistance_n > 0) {
    out += drift.resistance_n * (omega < drift.rolling_radps ? omega / drift.rolling_radps : 1);
  }
  return out;
}

HeldErrors held_errors(const BallParams& ball, const BeliefErrors& errors, const Arms& arms, const Drift& drift,
                       const Astray& astray) {
  HeldErrors out;
  out.mass_share = errors.mass_share;
  out.off_center_m = drift.off_center_m;
  const Real shell_off_m = kCorner * errors.center_of_mass_m;
  out.turns_kgm2 = ball.shell_mass_kg * shell_off_m * (2 * length(from(arms.shell_B_m)) + shell_off_m);
  out.omega_radps = astray.omega_radps(drift);
  out.tilt_rad = astray.tilt_rad(drift);
  return out;
}

}  // namespace ballast::firmware
