// A prescribed scenario as plain data for Simbody's ball (simbody_ball.h).
#pragma once

#include <stdexcept>

#include "sim/scenario/scenario.h"
#include "tests/simbody/simbody_ball.h"

namespace ballast::peer {

static_assert(firmware::kMaxMasses <= kMaxMasses);

// Throws std::invalid_argument for a start that does not roll.
inline Robot robot_of(const sim::Scenario& s) {
  if (s.initial.has_velocity || s.initial.height_m != 0)
    throw std::invalid_argument("initial: the Simbody ball starts rolling, without `velocity` or `height`");
  Robot robot;
  robot.radius_m = s.ball.radius_m;
  robot.gravity_mps2 = s.gravity_mps2;
  robot.shell_mass_kg = s.ball.mass_kg;
  robot.inertia_kgm2 = s.ball.inertia_kgm2;
  robot.center_of_mass_B_m = s.ball.center_of_mass_B_m;
  robot.orientation = s.initial.orientation;
  robot.angular_velocity_B_radps = s.initial.angular_velocity_B_radps;
  robot.position_W_m = s.initial.position_W_m;
  for (const sim::Mass& mass : s.masses) {
    Robot::Mass& out = robot.masses.emplace_back();
    out.mass_kg = mass.mass_kg;
    out.on_circle = mass.rail.shape == firmware::RailShape::kCircle;
    out.circle_radius_m = mass.rail.radius_m;
    out.origin_B_m = mass.rail.origin_B_m;
    out.axis_cos_B = mass.rail.axis_cos_B;
    out.axis_sin_B = mass.rail.axis_sin_B;
    out.initial_position = mass.initial_position;
    out.initial_velocity = mass.initial_velocity;
    for (const sim::MotionPiece& piece : mass.motion)
      out.motion.push_back({piece.duration_s, piece.acceleration_start, piece.acceleration_end});
  }
  robot.force_W_n = s.external_force_W_n;
  robot.force_times_s = s.force_table.times_s;
  robot.forces_W_n = s.force_table.forces_W_n;
  robot.drag_kgpm = s.drag.coefficient_kgpm;
  robot.wind_W_mps = s.drag.wind_W_mps;
  return robot;
}

}  // namespace ballast::peer
