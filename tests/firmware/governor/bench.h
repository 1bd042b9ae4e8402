// Closed loop of governor and ball with ideal masses: the rolling ball by the firmware's closed forms, one Runge-Kutta
// step per control tick, accelerations constant in a tick.
#pragma once

#include <cmath>

#include "firmware/governor/governor.h"
#include "firmware/model/rolling.h"
#include "firmware/motion/profile.h"

namespace ballast::firmware::testing {

inline RollingForces forces_of(const BallParams& ball, const RobotState& state, const PerMass<Real>& u) {
  MassMotion masses = motion_of(state);
  masses.acceleration = u;
  return rolling_forces(ball, state.orientation, state.angular_velocity_B_radps, masses);
}

inline RobotState moved(const BallParams& ball, const RobotState& state, const PerMass<Real>& u, Real h) {
  const auto at = [&](Real s, const TurningRate& rate) {
    RobotState out = state;
    TurningRate change;
    change.add(rate, s);
    apply(change, out);
    for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
      out.mass_position[i] += s * (state.mass_velocity[i] + s * u[i] / 2);
      out.mass_velocity[i] += s * u[i];
    }
    return out;
  };
  const auto rate = [&](const RobotState& x) {
    return turning_rate(x.orientation, x.angular_velocity_B_radps, forces_of(ball, x, u).angular_acceleration_B_radps2,
                        ball.radius_m);
  };
  const TurningRate a = rate(state), b = rate(at(h / 2, a)), c = rate(at(h / 2, b)), d = rate(at(h, c));
  TurningRate mean;
  mean.add(a, Real(1) / 6), mean.add(b, Real(1) / 3), mean.add(c, Real(1) / 3), mean.add(d, Real(1) / 6);
  return at(h, mean);
}

// Follows profiles from a tick on: u = theta'' + 2 w (theta' - v) + w^2 (theta - p).
struct ProfileLaw {
  const BallParams* ball;
  const PerMass<Profile>* profiles;
  Real bandwidth_radps;
  Wide start_s = 0;  // profile time at time 0 of the call

  PerMass<Real> operator()(Wide time_s, const RobotState& state) const {
    PerMass<Real> u{};
    for (std::size_t i = 0; i < static_cast<std::size_t>(ball->mass_count); ++i) {
      const ProfilePoint p = (*profiles)[i].at(start_s + time_s);
      const Real w = bandwidth_radps;
      u[i] = static_cast<Real>(p.acceleration) + 2 * w * (static_cast<Real>(p.velocity) - state.mass_velocity[i]) +
             w * w * (static_cast<Real>(p.position) - state.mass_position[i]);
    }
    return u;
  }
};

struct BenchResult {
  int ticks = 0, bent = 0, backup = 0, empty = 0, violations = 0;
  Real most_use = 0;  // f_s / (friction N), at the starts and the ends of ticks
  PerMass<Real> largest_bend{};
  Real first_violation_s = -1;
  RobotState end;
};

}  // namespace ballast::firmware::testing
