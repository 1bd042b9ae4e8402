// Runs of robots that were built with errors, tracked and not: the controller believes the robot of the plan.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/sil/run.h"

namespace ballast::tracking_test {

// Errors of one robot, and what else disturbs it.
struct Disturbance {
  double mass = 0;            // of every mass, uniform within +- this part of it
  double center_of_mass = 0;  // of each axis, uniform within +- this part of the radius
  double tilt_rad = 0;        // of the true start, about a level axis in any direction
  double slope_rad = 0;       // unknown to the controller, downhill in any direction
  double rolling_resistance = 0;
  double push = 0;  // of the weight, for a tenth of a second in any direction
  double push_time_s = 0;
};

// A scenario with a plan, believed to be true. Throws std::runtime_error where it is refused.
[[nodiscard]] sim::Scenario planned(sim::ScenarioResult read);
[[nodiscard]] sim::Scenario planned(const std::string& file, const std::vector<std::string>& overrides = {});

// The robot as it was built. The draws are those of `random`.
[[nodiscard]] sim::Scenario built(const sim::Scenario& planned, const Disturbance& disturbance,
                                  std::mt19937_64& random);

// A run in this process without a record. Throws std::runtime_error where it cannot be.
[[nodiscard]] sil::RunResult run(sim::Scenario scenario, bool tracking);

// The value that this part of them does not exceed.
[[nodiscard]] double quantile(std::vector<double> values, double part);

}  // namespace ballast::tracking_test
