// The stops at the ends of a line or an open spline: a one-sided spring and damper (Kelvin and Voigt), which pushes the
// mass back along its rail and never pulls. With the depth x of the mass beyond the end,
//   F = k x + c xdot   where x > 0 and that is > 0; else 0,   c = 2 D_r sqrt(k (m + J)).
// J is the rotor's inertia in rail units. The damping ratio D_r follows from the restitution e, the outgoing over the
// arriving speed of m + J against a ball held fast, with no other force. With time in units of sqrt((m + J) / k), D_r =
// cos(a) and arriving speed 1 the depth is exp(-D_r t) sin(t sin(a)) / sin(a); each derivative turns the phase by pi -
// a. So the force, -xddot, ends at t = 2 a / sin(a), where xdot = -exp(-D_r t):
//   e = exp(-2 a cot(a)),   a = acos(D_r)   (e^-2 at D_r = 1; above it acosh and coth).
// A stiff stop pushes hard for a short time. Its effect on N and f_s depends on k, so an impulse could not model it.
#pragma once

#include <algorithm>
#include <limits>

#include "firmware/model/rail.h"

namespace ballast::sim {

struct EndStopMaterial {
  double stiffness_npm = 0;
  double restitution = 0.5;  // 0.01..1, of the mass and its rotor against a ball held fast
};

// D_r for a restitution 0 < e <= 1.
double end_stop_damping_ratio(double restitution);

// Both stops of one rail. `side`: -1 the lower, +1 the upper, 0 neither. Positions in m.
class EndStops {
 public:
  EndStops() = default;  // no stops
  // `moving_inertia`: mass and rotor, m + J. Without stops unless both of the rail's ends are finite.
  EndStops(const firmware::Rail& rail, double moving_inertia, const EndStopMaterial& material);

  // The stop that pushes on a mass there.
  [[nodiscard]] int touched(double position, double velocity) const {
    return push_ahead(1, position, velocity) > 0 ? 1 : push_ahead(-1, position, velocity) > 0 ? -1 : 0;
  }
  // F of that side's spring and damper along the rail; 0 for side 0. It is smooth: it pulls where `side` is no longer
  // touched.
  [[nodiscard]] double force_n(int side, double position, double velocity) const {
    return side == 0 ? 0 : -side * stiffness_npm_ * (depth(side, position) + time_s_ * side * velocity);
  }
  // > 0 where touched() differs from `side`. Its zero is where a stop begins or ceases to push.
  [[nodiscard]] double overdue_m(int side, double position, double velocity) const {
    if (side != 0) return -push_ahead(side, position, velocity);
    return std::max(push_ahead(1, position, velocity), push_ahead(-1, position, velocity));
  }
  [[nodiscard]] bool present() const { return stiffness_npm_ > 0; }

 private:
  [[nodiscard]] double depth(int side, double position) const {
    return side > 0 ? position - upper_ : lower_ - position;
  }
  // The smaller of the depth and F / k, which is > 0 where that side pushes.
  [[nodiscard]] double push_ahead(int side, double position, double velocity) const {
    const double x = depth(side, position);
    return std::min(x, x + time_s_ * side * velocity);
  }

  double lower_ = -std::numeric_limits<double>::infinity();
  double upper_ = std::numeric_limits<double>::infinity();
  double stiffness_npm_ = 0;  // k
  double time_s_ = 0;         // c / k
};

}  // namespace ballast::sim
