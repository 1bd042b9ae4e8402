// How errors of estimate and belief change the friction that the ball needs.
//
// The derivatives of f_s - kappa N by attitude, angular velocity, masses and centre of mass are differences of the
// closed form at the state and the command of a tick, one of them per tick: an evaluation of rolling_forces() a tick. A
// round takes 8 + mass_count + 1 ticks.
//
// Invariants: fixed size, no heap. The same bits on every processor.
#pragma once

#include "firmware/governor/robot_state.h"

namespace ballast::firmware {

// Bounds of the errors, each of any sign.
struct StateErrors {
  Real tilt_rad = 0;          // of the attitude about either horizontal axis
  Real omega_radps = 0;       // of each component
  Real mass_share = 0;        // of each mass, the shell's included, as a part of it
  Real center_of_mass_m = 0;  // of each component of the shell's centre of mass
};

class Sensitivity {
 public:
  void reset() { *this = Sensitivity(); }

  // Takes the next derivative at this state with this command.
  void advance(const BallParams& ball, Real friction, const RobotState& state, const PerMass<Real>& u,
               const StateErrors& errors);

  // Bound of what all errors together add to f_s - kappa N, to first order, as a part of N. It lags behind the state by
  // up to a round.
  [[nodiscard]] Real share(int mass_count) const;

 private:
  static constexpr int kOthers = 8;  // 2 of tilt, 3 of Omega, 3 of the centre of mass
  std::array<Real, kOthers + 1 + kMaxMasses> part_{};
  int next_ = 0;
};

}  // namespace ballast::firmware
