#include "firmware/governor/sensitivity.h"

#include <cmath>

#include "firmware/governor/backup.h"
#include "firmware/governor/turning.h"
#include "firmware/model/ball_sums.h"

namespace ballast::firmware {

using detail::Attitude;
using detail::cross;
using detail::from;
using detail::Sums;
using detail::Vec;

namespace {

// The attitude turned by a small angle about axis e1 or e2 of space: qdot = omega q / 2.
Quaternion tilted(const Quaternion& q, int axis, Real angle) {
  Eigen::Matrix<Real, 4, 1> rate;
  if (axis == 0) {
    rate << -q.x() / 2, q.w() / 2, -q.z() / 2, q.y() / 2;
  } else {
    rate << -q.y() / 2, q.z() / 2, q.w() / 2, -q.x() / 2;
  }
  return turned(q, rate, angle);
}

// An error that is added to a belief. A copy of BallParams, with its splines, would take 25 kB of stack.
struct Believed {
  Vector3 center_of_mass_B_m = Vector3::Zero();
  Real shell_mass_share = 0;
  int mass = -1;  // that has mass_share added
  Real mass_share = 0;
};

// rolling_forces() of the ball with that added.
RollingForces forces_of(const BallParams& ball, const Believed& added, const Quaternion& orientation,
                        const Vector3& angular_velocity_B_radps, const MassMotion& masses) {
  const Attitude lambda(orientation);
  const Vec omega = from(angular_velocity_B_radps), r_gamma = ball.radius_m * lambda.gamma;
  const Vec against_weight = detail::against_weight(ball, lambda);
  const Vec chi0 = from(ball.center_of_mass_B_m) + from(added.center_of_mass_B_m);
  Sums sums;
  sums.add(ball.shell_mass_kg * (1 + added.shell_mass_share), r_gamma + chi0, cross(omega, cross(omega, chi0)),
           against_weight);
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const RailPoint<Real> rail = evaluate<Real>(ball.rail[k], masses.position[k]);
    const Real rate = masses.velocity[k], mass = ball.mass_kg[k] * (i == added.mass ? 1 + added.mass_share : 1);
    const Vec zeta = from(rail.position), d1 = from(rail.d1);
    const Vec c = cross(omega, cross(omega, zeta) + (2 * rate) * d1) + (rate * rate) * from(rail.d2) +
                  masses.acceleration[k] * d1;
    sums.add(mass, r_gamma + zeta, c, against_weight);
  }
  return detail::forces_of(ball, lambda, omega, sums);
}

}  // namespace

void Sensitivity::advance(const BallParams& ball, Real friction, const RobotState& state, const PerMass<Real>& u,
                          const StateErrors& errors) {
  MassMotion masses = motion_of(state);
  masses.acceleration = u;
  const Believed believed;
  const auto outside = [&](const Believed& b, const Quaternion& q, const Vector3& omega) {
    const RollingForces f = forces_of(ball, b, q, omega, masses);
    return Vector2(f.static_friction_n - friction * f.normal_force_n, f.normal_force_n);
  };
  // The whole error is the step: on both sides of the state, so that the bound holds the greater.
  const auto part = [&](const auto& moved) {
    const Vector2 here = outside(believed, state.orientation, state.angular_velocity_B_radps);
    const Real up = moved(Real(1))[0] - here[0], down = moved(Real(-1))[0] - here[0];
    const Real most = std::fmax(std::fmax(up, down), Real(0));
    return here[1] > 0 ? most / here[1] : Real(0);
  };
  const int k = next_;
  Real& slot = part_[static_cast<std::size_t>(k)];
  if (k < 2) {
    slot = part([&](Real sign) {
      return outside(believed, tilted(state.orientation, k, sign * errors.tilt_rad), state.angular_velocity_B_radps);
    });
  } else if (k < 5) {
    slot = part([&](Real sign) {
      Vector3 omega = state.angular_velocity_B_radps;
      omega[k - 2] += sign * errors.omega_radps;
      return outside(believed, state.orientation, omega);
    });
  } else {
    slot = part([&](Real sign) {
      Believed other;
      if (k < kOthers) {
        other.center_of_mass_B_m[k - 5] = sign * errors.center_of_mass_m;
      } else if (k == kOthers) {
        other.shell_mass_share = sign * errors.mass_share;
      } else {
        other.mass = k - kOthers - 1;
        other.mass_share = sign * errors.mass_share;
      }
      return outside(other, state.orientation, state.angular_velocity_B_radps);
    });
  }
  next_ = k + 1 < kOthers + 1 + ball.mass_count ? k + 1 : 0;
}

Real Sensitivity::share(int mass_count) const {
  Real sum = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kOthers + 1 + mass_count); ++k) sum += part_[k];
  return sum;
}

}  // namespace ballast::firmware
