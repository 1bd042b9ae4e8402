// Sweeps for the tests.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "tools/sweep/read_spec.h"

namespace ballast::test {

// A sweep of short prescribed runs that roll, slip and detach, by the contract's example.
inline const std::string kPaperSweep = R"(
scenario = "paper_ball"
runs = 40
seed = 1
[set]
"run.actuation" = "prescribed"
duration = 4.0
[vary]
"mass.0.mass" = { normal = [1.0, 0.05] }
"surface.static_friction" = { uniform = [0.1, 0.5] }
"initial.angular_velocity.1" = { grid = [-1.0, 0.0, 1.0] }
[keep]
values = ["mu_required.max", "normal_force.min", "final.position", "tracking.rms", "end.reason"]
)";

// A sweep with controller, steppers and monitor.
inline const std::string kStepperSweep = R"(
scenario = "paper_ball"
runs = 12
seed = 7
[set]
duration = 0.3
[vary]
"mass.0.mass" = { log_uniform = [0.5, 2.0] }
"mass.1.motor.microsteps" = { choice = [8, 16] }
[keep]
values = ["end.reason", "mu_required.max", "motors.0.steps", "trip.cause"]
)";

inline sweep::Spec spec_of(const std::string& toml) {
  std::vector<sim::ScenarioError> errors;
  const auto spec = sweep::parse_spec(toml, "test.toml", ".", errors);
  for (const auto& error : errors) ADD_FAILURE() << sim::to_string(error);
  return spec.value_or(sweep::Spec{});
}

inline std::string errors_of(const std::string& toml) {
  std::vector<sim::ScenarioError> errors;
  const auto spec = sweep::parse_spec(toml, "test.toml", ".", errors);
  EXPECT_EQ(spec.has_value(), errors.empty());
  std::string text;
  for (const auto& error : errors) text += sim::to_string(error) + '\n';
  return text;
}

}  // namespace ballast::test
