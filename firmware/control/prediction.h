// What a stop or a move will do to N and f_s, computed before its first step.
#pragma once

#include "firmware/model/rolling.h"
#include "firmware/motion/profile.h"

namespace ballast::firmware {

// Least and greatest of the paper's closed forms along profiles, from profile time 0 to horizon_s.
struct Prediction {
  Wide duration_s = 0;
  Wide horizon_s = 0;  // how far it looks: duration_s, or less of what takes long
  Real normal_force_min_n = 0;
  Real mu_required_max = 0;  // f_s / N; +infinity where N <= 0
  Real margin_min = 0;       // 1 - f_s / (mu_s N); 1 with perfect friction; -1 where N <= 0
};

// Grid of a prediction. It is refined by the borders of all pieces, where accelerations have their corners, unless it
// is to be coarse: then a piece shorter than its intervals may be passed over, for 19 evaluations however many masses
// stop each in their own time.
inline constexpr int kCoarseIntervals = 8;
inline constexpr int kPredictionIntervals = 16;
inline constexpr Real kPredictionStep = 0.5;

// The attitude is not frozen: Omegadot of the closed form is integrated by the explicit midpoint rule. One step of
// `lead_s` comes first, from the sensed state at the tick's start to profile time 0, with the masses as `now`; then one
// step per interval of the refined grid. N and f_s are taken at both ends of every interval: two evaluations an
// interval, at most kPredictionIntervals + 3 or 7 borders a mass, so the cost is bounded: 44 evaluations for a stop of
// three masses. It assumes what the closed forms assume: rolling without slip, masses exactly on their profiles, the
// constant external force; what step motors add by lagging and swinging is not in it.
//
// An interval is no longer than the rule is good for: h |Omega|, h sqrt(g / r) and h^2 |Omegadot| at most
// kPredictionStep at its start (a ball rolling as a pendulum swings more slowly than sqrt(g / r)). If the intervals are
// used up before duration_s, that is the horizon.
[[nodiscard]] Prediction predict_motion(const BallParams& ball, Real static_friction, const Quaternion& orientation,
                                        const Vector3& angular_velocity_B_radps, const MassMotion& now, Wide lead_s,
                                        const PerMass<Profile>& profiles, Wide duration_s, bool coarse = false);

// A point of a profile as the model takes it.
inline void put(const ProfilePoint& point, std::size_t mass, MassMotion& masses) {
  masses.position[mass] = static_cast<Real>(point.position);
  masses.velocity[mass] = static_cast<Real>(point.velocity);
  masses.acceleration[mass] = static_cast<Real>(point.acceleration);
}

// f_s / N and the margin of one state, as in Prediction.
void friction_use(const RollingForces& forces, Real static_friction, Real& mu_required, Real& margin);

}  // namespace ballast::firmware
