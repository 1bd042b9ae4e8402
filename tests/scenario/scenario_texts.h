// Scenario texts and shorthands the scenario tests share.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "sim/scenario/scenario.h"

namespace ballast::sim {

// Every key once, none at its default, two kinds of rail.
inline const std::string kFull = R"(name = "full"
duration = 4.0
gravity = 9.0
external_force = [0.1, 0.2, 0.3]
seed = 7

[ball]
radius = 2.0
mass = 3.0
inertia = [1.0, 1.1, 1.2]
center_of_mass = [0.01, 0.02, -0.03]

[surface]
static_friction = 0.5
kinetic_friction = 0.4
restitution = 0.1
rolling_resistance = 0.02
spin_friction = 0.003
creep = 0.04
slope = { angle = 0.05, downhill = 0.7 }

[[mass]]
mass = 0.5
rail = { shape = "circle", radius = 1.5, direction = { azimuth = 0.3, elevation = 0.4 } }
initial_position = 0.25
initial_velocity = 0.125
motion = [ { duration = 0.5, acceleration = [1.0, 2.0] },
           { duration = 0.25, acceleration = [2.0, -3.0] } ]
[mass.motor]
steps_per_revolution = 400
microsteps = 8
gear_ratio = 3.0
holding_torque = 30.0
detent_torque = 0.5
rotor_inertia = 0.001
viscous_damping = 0.25
corner_speed = 40.0
step_error = 0.02
max_step_rate = 12000.0
max_acceleration = 5.0
max_jerk = 50.0

[[mass]]
mass = 0.75
rail = { shape = "line", origin = [0, 0, -0.2], direction = [2, 0, 0], end_stops = [-1.5, 1.5], end_stop_stiffness = 5000.0, end_stop_restitution = 0.75 }
motion = [ { duration = 1.0, acceleration = [0.0, 0.5] }, { duration = 1.0, acceleration = [-0.5, 0.0] } ]
[mass.motor]
travel_per_revolution = 0.5

[[mass]]
mass = 0.25
rail = { shape = "circle", radius = 0.3, center = [0, 0, 0.1], axes = [[1, 0, 0], [0, 0, 1]] }

[initial]
orientation = [0.6, 0.8, 0.0, 0.0]
angular_velocity = [0.1, 0.2, 0.3]
position = [1.0, 2.0]
height = 0.0

[run]
actuation = "stepper"
control_period = 0.002
timer_frequency = 1e6
on_violation = "stop"

[envelope]
min_normal_force = 1.0
friction_use = 0.9

[[published]]
quantity = "mu_required.max"
value = 0.19
source = "somewhere"
)";

// Keys that exclude those of kFull: splines, trajectories, forces that change.
inline const std::string kPaths = R"(duration = 4.0
gravity = 9.0
external_force = { times = [0.5, 1.5, 3.0], forces = [[0.1, 0, 0], [0, 0.2, 0], [0, 0, -0.1]] }
[drag]
coefficient = 0.25
wind = [3, 0, -1]
[ball]
radius = 2.0
mass = 3.0
inertia = [1.0, 1.1, 1.2]
[[mass]]
mass = 0.5
rail = { shape = "spline", closed = true, points = [[1, 0, 0], [0, 1, 0.5], [-1, 0, 0], [0, -1, -0.5]] }
initial_velocity = 0.25
[[mass]]
mass = 0.5
rail = { shape = "spline", points = [[-1, 0, 0.5], [0, 0, 0], [1, 0, 0.5]] }
initial_position = 0.5
[mass.motor]
travel_per_revolution = 0.5
[[mass]]
mass = 0.25
trajectory = { times = [-1, 0, 2, 4.5], points = [[0, 0, 0], [0, 0, 0.5], [0, 0.5, 0], [0.5, 0, 0]] }
[[mass]]
mass = 0.25
[mass.trajectory]
periodic = true
times = [1, 2, 3, 5]
points = [[0, 0, 0], [0, 0, 0.5], [0, 0.5, 0], [0, 0, 0]]
[run]
actuation = "prescribed"
)";

// Only what is required.
inline const std::string kMinimal = R"(duration = 4.0
gravity = 1.0
[ball]
radius = 2.0
mass = 3.0
inertia = [1.0, 1.1, 1.2]
)";

inline std::string all_errors(const ScenarioResult& result) {
  std::string text;
  for (const ScenarioError& error : result.errors) text += to_string(error) + "\n";
  return text;
}

inline ScenarioResult parse(const std::string& toml, const std::vector<std::string>& overrides = {}) {
  return parse_scenario(toml, "test.toml", overrides);
}

// The scenario of a text that must be without fault.
inline Scenario accepted(const std::string& toml, const std::vector<std::string>& overrides = {}) {
  const ScenarioResult result = parse(toml, overrides);
  EXPECT_TRUE(result.ok()) << all_errors(result);
  return result.scenario;
}

// The one and only fault of a text.
inline ScenarioError only_error(const std::string& toml, const std::vector<std::string>& overrides = {}) {
  const ScenarioResult result = parse(toml, overrides);
  EXPECT_EQ(result.errors.size(), 1u) << all_errors(result);
  return result.errors.empty() ? ScenarioError{} : result.errors.front();
}

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

inline int line_of(const std::string& text, const std::string& part) {
  int line = 1;
  for (std::size_t i = 0; i < text.find(part); ++i) line += text[i] == '\n';
  return line;
}

inline ::testing::AssertionResult contains(const std::string& text, const std::string& part) {
  if (text.find(part) != std::string::npos) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "\"" << text << "\" lacks \"" << part << "\"";
}

}  // namespace ballast::sim
