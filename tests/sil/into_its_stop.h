// A robot whose motor loses steps on the way out, so that the way back, which it follows, ends in the stop of its rail.
#pragma once

namespace ballast::test {

inline constexpr const char* kIntoItsStop = R"(
name = "into_its_stop"
duration = 3.0
gravity = 9.81
[ball]
radius = 0.2
mass = 3.0
inertia = [0.05, 0.05, 0.05]
center_of_mass = [0.0, 0.0, -0.05]
[surface]
static_friction = 0.6
[[mass]]
mass = 0.2
rail = { shape = "line", origin = [0, 0, -0.05], direction = [1, 0, 0], end_stops = [-0.02, 0.15], end_stop_restitution = 0.4 }
motion = [ { duration = 0.2, acceleration = [3.0, 3.0] }, { duration = 0.2, acceleration = [-3.0, -3.0] },
           { duration = 0.6, acceleration = [-0.3333, -0.3333] }, { duration = 0.6, acceleration = [0.3333, 0.3333] } ]
[mass.motor]
travel_per_revolution = 0.05
rotor_inertia = 2e-5
holding_torque = 0.0075
viscous_damping = 1e-4
)";

}  // namespace ballast::test
