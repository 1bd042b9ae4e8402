#include "firmware/control/prediction.h"

#include <cmath>
#include <limits>

#include "firmware/model/rolling.h"

namespace ballast::firmware {

namespace {

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

// Returns the first border of any piece after time_s; infinity if there is none.
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

void Predictor::begin(const Quaternion& orientation, const Vector3& angular_velocity_B_radps, const MassMotion& masses,
                      Wide control_period_s, int lead_ticks, const PerMass<Profile>& profiles, int mass_count) {
  phase_ = Phase::kLead;
  orientation_ = orientation;
  angular_velocity_B_radps_ = angular_velocity_B_radps;
  lead_masses_ = masses;
  lead_step_s_ = control_period_s;
  lead_steps_left_ = lead_ticks;
  // Never more than the grid's intervals and the borders. The bound also ends a prediction whose step is NaN or
  // vanishes beside the time.
  intervals_left_ = kPredictionIntervals;
  grid_ = 1;
  time_s_ = 0;
  result_ = {0, 0, std::numeric_limits<Real>::infinity(), 0, 1};
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    intervals_left_ += profiles[i].piece_count();
    result_.duration_s = std::fmax(result_.duration_s, profiles[i].end_s());
  }
}

void Predictor::advance(const BallParams& ball, Real static_friction, const PerMass<Profile>& profiles, int steps) {
  for (int k = 0; k < steps; ++k) {
    if (phase_ == Phase::kLead && lead_steps_left_ == 0) phase_ = Phase::kIntervals;
    if (phase_ == Phase::kIntervals && !(intervals_left_ > 0 && time_s_ < result_.duration_s)) {
      phase_ = Phase::kLastPoint;
    }
    switch (phase_) {
      case Phase::kLead:
        step_attitude(ball, forces(ball, lead_masses_), lead_masses_, static_cast<Real>(lead_step_s_));
        --lead_steps_left_;
        break;
      case Phase::kIntervals:
        step_interval(ball, static_friction, profiles);
        --intervals_left_;
        break;
      case Phase::kLastPoint:
        take(forces(ball, masses_at(profiles, ball.mass_count, time_s_)), static_friction);
        result_.horizon_s = time_s_;
        phase_ = Phase::kComplete;
        return;
      case Phase::kIdle:
      case Phase::kComplete:
        return;
    }
  }
}

void Predictor::step_interval(const BallParams& ball, Real static_friction, const PerMass<Profile>& profiles) {
  const RollingForces start = forces(ball, masses_at(profiles, ball.mass_count, time_s_));
  take(start, static_friction);
  const Wide duration_s = result_.duration_s;
  const Wide grid_s = grid_ < kPredictionIntervals ? duration_s * grid_ / kPredictionIntervals : duration_s;
  const Real longest_s = longest_step_s(ball, angular_velocity_B_radps_, start.angular_acceleration_B_radps2);
  const Wide border_s = next_border(profiles, ball.mass_count, time_s_);
  const Wide end_s = std::fmin(std::fmin(grid_s, time_s_ + Wide{longest_s}), border_s);
  if (end_s == grid_s) ++grid_;
  const MassMotion middle = masses_at(profiles, ball.mass_count, (time_s_ + end_s) / 2);
  step_attitude(ball, start, middle, static_cast<Real>(end_s - time_s_));
  time_s_ = end_s;
}

// One step of the midpoint rule; `start` are the forces at its beginning.
void Predictor::step_attitude(const BallParams& ball, const RollingForces& start, const MassMotion& middle_masses,
                              Real h_s) {
  const Quaternion orientation = orientation_;
  const Vector3 omega = angular_velocity_B_radps_;
  orientation_ = turned(orientation, omega, h_s / 2);
  angular_velocity_B_radps_ = omega + h_s / 2 * start.angular_acceleration_B_radps2;
  const RollingForces middle = forces(ball, middle_masses);
  orientation_ = turned(orientation, angular_velocity_B_radps_, h_s);
  angular_velocity_B_radps_ = omega + h_s * middle.angular_acceleration_B_radps2;
}

RollingForces Predictor::forces(const BallParams& ball, const MassMotion& masses) const {
  return rolling_forces(ball, orientation_, angular_velocity_B_radps_, masses);
}

// Each comparison lets NaN through.
void Predictor::take(const RollingForces& forces, Real static_friction) {
  Real mu = 0, margin = 0;
  friction_use(forces, static_friction, mu, margin);
  if (!(forces.normal_force_n >= result_.normal_force_min_n)) result_.normal_force_min_n = forces.normal_force_n;
  if (!(mu <= result_.mu_required_max)) result_.mu_required_max = mu;
  if (!(margin >= result_.margin_min)) result_.margin_min = margin;
}

}  // namespace ballast::firmware
