// The ball of the step loads: the paper's, with radius, gravity and shell of 1, on a floor that always holds.
#pragma once

#include <limits>

#include "firmware/control/params.h"

namespace ballast::hal::test {

// Its masses, rails and motors are still to be said.
inline firmware::BallParams& unit_ball(int mass_count, firmware::ControllerParams& params) {
  params.static_friction = std::numeric_limits<firmware::Real>::infinity();
  params.sensor_stale_ticks = 3;
  params.monitor_stale_ticks = 5;
  params.ball.radius_m = 1;
  params.ball.gravity_mps2 = 1;
  params.ball.shell_mass_kg = 1;
  params.ball.inertia_kgm2 = firmware::Vector3(firmware::Real(0.9), 1, firmware::Real(1.1));
  params.ball.mass_count = mass_count;
  return params.ball;
}

}  // namespace ballast::hal::test
