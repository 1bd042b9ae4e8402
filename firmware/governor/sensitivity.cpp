#include "firmware/governor/sensitivity.h"

#include <cmath>

#include "firmware/governor/backup.h"
#include "firmware/governor/turning.h"
#include "firmware/model/rolling.h"

namespace ballast::firmware {

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

}  // namespace

void Sensitivity::advance(const BallParams& ball, Real friction, const RobotState& state, const PerMass<Real>& u,
                          const StateErrors& errors) {
  MassMotion masses = motion_of(state);
  masses.acceleration = u;
  const auto outside = [&](const Quaternion& q, const Vector3& omega) {
    const RollingForces f = rolling_forces(ball, q, omega, masses);
    return Vector2(f.static_friction_n - friction * f.normal_force_n, f.normal_force_n);
  };
  const Quaternion& q = state.orientation;
  const Vector3& omega = state.angular_velocity_B_radps;
  const Vector2 here = outside(q, omega);
  // The whole error is the step: on both sides of the state, so that the bound holds the greater.
  Real most = 0;
  for (const Real sign : {Real(1), Real(-1)}) {
    Vector3 faster = omega;
    if (next_ >= 2) faster[next_ - 2] += sign * errors.omega_radps;
    const Vector2 there = outside(next_ < 2 ? tilted(q, next_, sign * errors.tilt_rad) : q, faster);
    most = std::fmax(most, there[0] - here[0]);
  }
  part_[static_cast<std::size_t>(next_)] = here[1] > 0 ? most / here[1] : 0;
  next_ = (next_ + 1) % static_cast<int>(part_.size());
}

Real Sensitivity::share() const {
  Real sum = 0;
  for (const Real part : part_) sum += part;
  return sum;
}

}  // namespace ballast::firmware
