// Robots that were built with errors, run and identified: the controller believes the nominal robot. The truth is used
// to run the plant, and to judge what was identified.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/identify/fit.h"
#include "tools/sil/run_result.h"

namespace ballast::identify_test {

// Errors of the robot that is built, uniform within these.
struct Errors {
  double mass = 0.1;                  // of each mass, the shell's included: parts of it
  double inertia = 0.1;               // parts of each moment
  double center_of_mass = 0.01;       // of each axis, in parts of the radius
  double rolling_resistance = 0.002;  // from 0 up; 0 is believed
};

// The robot as it was built; the scenario's own is believed. The seed of its sensors is drawn too.
[[nodiscard]] sim::Scenario built(const sim::Scenario& nominal, const Errors& errors, std::mt19937_64& random);

// The scenario with another belief.
[[nodiscard]] sim::Scenario believing(sim::Scenario scenario, const identify::Parameters& parameters,
                                      const Eigen::VectorXd& values);

// Runs in this process. Throws std::runtime_error where that fails.
struct Recorded {
  identify::Recording recording;
  sil::RunResult result;
};
[[nodiscard]] Recorded record(const sim::Scenario& scenario);

// The true values of the parameters: for judging only.
[[nodiscard]] Eigen::VectorXd truth(const identify::Parameters& parameters, const sim::Scenario& scenario);

}  // namespace ballast::identify_test
