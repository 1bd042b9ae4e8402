// The integrator's state, and what the equations give for it.
#pragma once

#include <array>
#include <cstddef>

#include "sim/plant/newton_euler.h"

namespace ballast::sim {

// Layout of the state: q (w, x, y, z), Omega (body frame), z (of the geometric centre, horizontal), then with driven
// masses theta and thetadot. Outside rolling, height and velocity (space frame) of the geometric centre follow
// (Equations::contact_start()).
inline constexpr std::size_t kQ = 0, kOmega = 4, kZ = 7, kTheta = 9;
inline constexpr std::size_t kStateCapacity = kTheta + 2 * std::size_t{kMaxMasses} + 4;
using State = std::array<double, kStateCapacity>;

// The equations' answer at one instant, and the values that decide whether sliding and flight go on. Rolling sets
// neither of them.
struct Instant : Motion {
  double remaining = 0;        // slip velocity along the direction of the slip (sliding); height (flight)
  double height_rate_mps = 0;  // flight
};

struct Point {
  State y, dydt;
  Instant motion;
};

}  // namespace ballast::sim
