// Predicts N and f_s along a stop or a move, a few steps per control tick.
//
// Invariants: fixed size, no heap; one call does at most the number of steps that the caller allows.
#pragma once

#include "firmware/control/status.h"

namespace ballast::firmware {

// Intervals of the grid over the whole motion. The borders of all pieces, where accelerations have their corners,
// refine it.
inline constexpr int kPredictionIntervals = 16;
inline constexpr Real kPredictionStep = 0.5;

// Steps per control tick, each of at most two evaluations of the closed forms. A tick in which the masses move also
// generates their pulses, so it has less time left.
inline constexpr int kPredictionStepsMoving = 2;
inline constexpr int kPredictionStepsHolding = 6;

// Steps that a prediction takes at most: one per tick of lead, the grid, the borders, and the last point.
constexpr int most_prediction_steps(int lead_ticks, int borders) {
  return lead_ticks + kPredictionIntervals + borders + 1;
}

// Integrates the attitude: Omegadot of the closed form by the explicit midpoint rule. The lead comes first, from the
// sensed state to profile time 0, one step per control tick, with the masses as they were commanded at its start. Then
// comes one step per interval of the refined grid. N and f_s are taken at both ends of every interval.
//
// An interval is no longer than the rule is good for: h |Omega|, h sqrt(g / r) and h^2 |Omegadot| are at most
// kPredictionStep at its start (a ball rolling as a pendulum swings more slowly than sqrt(g / r)). If the intervals are
// used up before the motion ends, the prediction ends there: horizon_s.
//
// Limits: rolling without slip, masses exactly on their profiles, the constant external force. The lag and swing of
// step motors are not included. The moment of a floor that resists fades below creep_radps, which is slower than a step
// resolves: near rest Omega is off by up to h c_rr g / r, and f_s by a few c_rr N.
class Predictor {
 public:
  // Starts a prediction of `profiles`, which begin `lead_ticks` control ticks after the sensed state. A prediction
  // under way is dropped. `orientation`: body -> space, unit. `masses`: commanded at the time of the sensed state.
  void begin(const Quaternion& orientation, const Vector3& angular_velocity_B_radps, const MassMotion& masses,
             Wide control_period_s, int lead_ticks, const PerMass<Profile>& profiles, int mass_count);

  // Does at most `steps` steps. `profiles` are those of begin(). Once it is complete, this does nothing.
  void advance(const BallParams& ball, Real static_friction, const PerMass<Profile>& profiles, int steps);

  // Drops a prediction under way: no result will come of it.
  void drop() { phase_ = Phase::kIdle; }

  // False from begin() until the last step, and after drop().
  [[nodiscard]] bool complete() const { return phase_ == Phase::kComplete; }
  // Valid once complete.
  [[nodiscard]] const Prediction& result() const { return result_; }

 private:
  enum class Phase : std::uint8_t { kIdle, kLead, kIntervals, kLastPoint, kComplete };

  void step_interval(const BallParams& ball, Real static_friction, const PerMass<Profile>& profiles);
  void step_attitude(const BallParams& ball, const RollingForces& start, const MassMotion& middle_masses, Real h_s);
  [[nodiscard]] RollingForces forces(const BallParams& ball, const MassMotion& masses) const;
  void take(const RollingForces& forces, Real static_friction);

  Phase phase_ = Phase::kIdle;
  Quaternion orientation_{1, 0, 0, 0};  // unit
  Vector3 angular_velocity_B_radps_ = Vector3::Zero();
  MassMotion lead_masses_;
  Wide lead_step_s_ = 0;
  int lead_steps_left_ = 0;
  int intervals_left_ = 0;
  int grid_ = 1;     // index of the grid point that ends the next interval at the latest
  Wide time_s_ = 0;  // profile time
  Prediction result_;
};

// Copies a point of a profile into the model's motion of the masses.
inline void put(const ProfilePoint& point, std::size_t mass, MassMotion& masses) {
  masses.position[mass] = static_cast<Real>(point.position);
  masses.velocity[mass] = static_cast<Real>(point.velocity);
  masses.acceleration[mass] = static_cast<Real>(point.acceleration);
}

// Computes f_s / N and the margin of one state, as in Prediction.
void friction_use(const RollingForces& forces, Real static_friction, Real& mu_required, Real& margin);

}  // namespace ballast::firmware
