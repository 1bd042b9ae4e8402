// How errors of the estimate change the friction that the ball needs.
//
// The derivatives of f_s - kappa N by attitude and angular velocity are differences of the closed form at the state and
// the command of a tick, one of them per tick. A round takes 5 ticks.
//
// Invariants: fixed size, no heap. The same bits on every processor.
#pragma once

#include "firmware/governor/robot_state.h"

namespace ballast::firmware {

// Bounds of the errors, each of any sign.
struct StateErrors {
  Real tilt_rad = 0;     // of the attitude about either horizontal axis
  Real omega_radps = 0;  // of each component
};

class Sensitivity {
 public:
  void reset() { *this = Sensitivity(); }

  // Takes the next derivative at this state with this command.
  void advance(const BallParams& ball, Real friction, const RobotState& state, const PerMass<Real>& u,
               const StateErrors& errors);

  // Bound of what all errors together add to f_s - kappa N, to first order, as a part of N. It lags behind the state by
  // up to a round.
  [[nodiscard]] Real share() const;

 private:
  std::array<Real, 5> part_{};  // 2 of tilt, 3 of Omega
  int next_ = 0;
};

}  // namespace ballast::firmware
