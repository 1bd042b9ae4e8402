#include "firmware/control/prediction.h"

#include <cmath>
#include <limits>

namespace ballast::firmware {

namespace {

struct Attitude {
  Quaternion orientation;  // unit
  Vector3 angular_velocity_B_radps;
};

// q + h/2 q (0, Omega), normalised: the rotation by h Omega up to order h^3.
Quaternion turned(const Quaternion& q, const Vector3& omega, Real h) {
  const Real x = omega[0] * h / 2, y = omega[1] * h / 2, z = omega[2] * h / 2;
  const Real w = q.w() - q.x() * x - q.y() * y - q.z() * z;
  const Real i = q.x() + q.w() * x + q.y() * z - q.z() * y;
  const Real j = q.y() + q.w() * y + q.z() * x - q.x() * z;
  const Real k = q.z() + q.w() * z + q.x() * y - q.y() * x;
  const Real norm = std::sqrt(w * w + i * i + j * j + k * k);
  return {w / norm, i / norm, j / norm, k / norm};
}

MassMotion masses_at(const PerMass<Profile>& profiles, int count, Wide time_s) {
  MassMotion masses;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    put(profiles[i].at(time_s), i, masses);
  }
  return masses;
}

// The first border of any piece after time_s.
Wide next_border(const PerMass<Profile>& profiles, int count, Wide time_s) {
  Wide next = std::numeric_limits<Wide>::infinity();
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i) {
    const int after = profiles[i].locate(time_s).index + 1;
    if (after <= profiles[i].piece_count()) next = std::fmin(next, profiles[i].cubic_start_s(after));
  }
  return next;
}

Real norm(const Vector3& v) { return std::sqrt(v.dot(v)); }

Real longest_step_s(const BallParams& ball, const Vector3& omega, const Vector3& omega_dot) {
  const Real fastest = std::fmax(norm(omega), std::sqrt(ball.gravity_mps2 / ball.radius_m));
  return std::fmin(kPredictionStep / fastest, std::sqrt(kPredictionStep / norm(omega_dot)));
}

}  // namespace

void friction_use(const RollingForces& forces, Real static_friction, Real& mu_required, Real& margin) {
  if (!(forces.normal_force_n > 0)) {
    mu_required = std::numeric_limits<Real>::infinity();
    margin = -1;
    return;
  }
  mu_required = forces.static_friction_n / forces.normal_force_n;
  margin = std::isinf(static_friction) ? 1 : 1 - mu_required / static_friction;
}

Prediction predict_motion(const BallParams& ball, Real static_friction, const Quaternion& orientation,
                          const Vector3& angular_velocity_B_radps, const MassMotion& now, Wide lead_s,
                          const PerMass<Profile>& profiles, Wide duration_s, bool coarse) {
  const int count = ball.mass_count;
  Prediction result{duration_s, 0, std::numeric_limits<Real>::infinity(), 0, 1};
  Attitude at{orientation, angular_velocity_B_radps};
  const auto forces = [&](const MassMotion& masses) {
    return rolling_forces(ball, at.orientation, at.angular_velocity_B_radps, masses);
  };
  // One step of the midpoint rule; `start` are the forces at its beginning.
  const auto advance = [&](const RollingForces& start, const MassMotion& middle_masses, Real h) {
    const Attitude begin = at;
    at.orientation = turned(begin.orientation, begin.angular_velocity_B_radps, h / 2);
    at.angular_velocity_B_radps = begin.angular_velocity_B_radps + h / 2 * start.angular_acceleration_B_radps2;
    const RollingForces middle = forces(middle_masses);
    at.orientation = turned(begin.orientation, at.angular_velocity_B_radps, h);
    at.angular_velocity_B_radps = begin.angular_velocity_B_radps + h * middle.angular_acceleration_B_radps2;
  };
  const auto look = [&](const RollingForces& f) {
    Real mu = 0, margin = 0;
    friction_use(f, static_friction, mu, margin);
    // Written so that NaN is taken over.
    if (!(f.normal_force_n >= result.normal_force_min_n)) result.normal_force_min_n = f.normal_force_n;
    if (!(mu <= result.mu_required_max)) result.mu_required_max = mu;
    if (!(margin >= result.margin_min)) result.margin_min = margin;
  };

  advance(forces(now), now, static_cast<Real>(lead_s));
  Wide time_s = 0;
  // Never more than the grid's intervals and the borders; the bound also ends it should a number be none or a step
  // vanish beside the time.
  int borders = 0;
  for (int i = 0; i < count && !coarse; ++i) borders += profiles[static_cast<std::size_t>(i)].piece_count();
  const int intervals = coarse ? kCoarseIntervals : kPredictionIntervals;
  int grid = 1;
  for (int k = 0; k < intervals + borders && time_s < duration_s; ++k) {
    const RollingForces start = forces(masses_at(profiles, count, time_s));
    look(start);
    const Wide grid_s = grid < intervals ? duration_s * grid / intervals : duration_s;
    const Real longest_s = longest_step_s(ball, at.angular_velocity_B_radps, start.angular_acceleration_B_radps2);
    Wide end_s = std::fmin(grid_s, time_s + Wide{longest_s});
    if (!coarse) end_s = std::fmin(end_s, next_border(profiles, count, time_s));
    if (end_s == grid_s) ++grid;
    advance(start, masses_at(profiles, count, (time_s + end_s) / 2), static_cast<Real>(end_s - time_s));
    time_s = end_s;
  }
  look(forces(masses_at(profiles, count, time_s)));
  result.horizon_s = time_s;
  return result;
}

}  // namespace ballast::firmware
