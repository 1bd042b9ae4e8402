// ballast check: lists every error in a scenario; else its implausible values, what its floor and motors lack, and what
// it is.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <numbers>

#include "sim/scenario/reader.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/floor_check.h"
#include "tools/ballast/motor_check.h"
#include "tools/plan/read_task.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"
#include "tools/recording/record_run.h"

namespace ballast {
namespace {

// A log that is worth a warning.
constexpr double kLargeLog_bytes = 10e9;

std::vector<std::string> warnings_of(const sim::Scenario& scenario, const std::vector<sim::ScenarioError>& found) {
  std::vector<std::string> texts;
  for (const sim::ScenarioError& warning : found) texts.push_back(sim::to_string(warning));
  const double log_bytes = sil::expected_log_bytes(scenario);
  if (log_bytes > kLargeLog_bytes) {
    texts.push_back(fmt::format("duration: {} s in ticks of {} s make a log of about {} GB",
                                sim::number_text(scenario.duration_s), sim::number_text(scenario.run.control_period_s),
                                program::short_number(log_bytes / 1e9)));
  }
  return texts;
}

// Empty for an ideal floor.
std::string real_floor_text(const sim::Surface& floor) {
  std::string text;
  if (floor.rolling_resistance > 0)
    text += fmt::format(", rolling resistance {}", sim::number_text(floor.rolling_resistance));
  if (floor.spin_friction_m > 0) text += fmt::format(", spin friction {} m", sim::number_text(floor.spin_friction_m));
  if (floor.slope_rad > 0) text += fmt::format(", slope {:.3g} degrees", floor.slope_rad * 180 / std::numbers::pi);
  if (!floor.patches.empty())
    text += fmt::format(", {} patch{}", floor.patches.size(), floor.patches.size() == 1 ? "" : "es");
  return text;
}

// Empty where nothing is believed but the truth.
std::string belief_text(const sim::Scenario& scenario) {
  if (scenario.belief_is_written) return "; controller, monitor and planner go by [believed]";
  return "";
}

// Errors in the [task] of a scenario that is to be planned. A run ignores them, so they are warnings here.
void add_task_errors(const program::ScenarioOptions& options, const sim::Scenario& scenario,
                     std::vector<sim::ScenarioError>& found) {
  const auto of_task = [](const sim::ScenarioError& warning) { return warning.key == "task"; };
  if (std::none_of(found.begin(), found.end(), of_task)) return;
  std::vector<sim::ScenarioError> errors;
  const bool as_in_file = options.set.empty() && options.actuation.empty() && !options.seed;
  const auto task = as_in_file ? plan::read_task(program::find_scenario(options.scenario), errors)
                               : plan::parse_task(scenario.toml, "with the command line's values", errors);
  if (!task) found.insert(found.end(), errors.begin(), errors.end());
}

}  // namespace

std::function<int()> add_check_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("check", "Validates a scenario and lists every error in it");
  auto options = std::make_shared<program::ScenarioOptions>();
  program::add_scenario_options(*command, *options);
  return [options] {
    std::vector<sim::ScenarioError> found;
    const auto scenario = program::load_scenario(*options, &found);
    if (!scenario) return program::kExitUsage;
    const bool stepper = scenario->run.actuation == sim::Actuation::kStepper;
    if (sim::has_controller(scenario->run.actuation) && !program::make_controller_params("ballast", *scenario))
      return program::kExitUsage;
    add_task_errors(*options, *scenario, found);
    std::vector<std::string> warnings = warnings_of(*scenario, found);
    // One of them may say why rolling the ball, which comes next, takes long.
    for (const std::string& warning : warnings) std::cout << "warning: " << warning << std::endl;
    const std::size_t said = warnings.size();
    FloorFindings floor = check_floor(*scenario);
    warnings.insert(warnings.end(), floor.warnings.begin(), floor.warnings.end());
    MotorFindings motors;
    if (stepper) motors = check_motors(*scenario);
    warnings.insert(warnings.end(), motors.warnings.begin(), motors.warnings.end());
    for (std::size_t i = said; i < warnings.size(); ++i) std::cout << "warning: " << warnings[i] << '\n';
    floor.notes.insert(floor.notes.end(), motors.notes.begin(), motors.notes.end());
    for (const std::string& note : floor.notes) std::cout << "note: " << note << '\n';
    const std::string verdict = warnings.empty()       ? "good"
                                : warnings.size() == 1 ? "can be run, with 1 warning"
                                                       : fmt::format("can be run, with {} warnings", warnings.size());
    const double friction = scenario->surface.static_friction;
    std::cout << fmt::format("{}: {}. {} {}, {}, {} s in ticks of {} s, mu_s {}{}{}\n", scenario->name, verdict,
                             scenario->masses.size(), scenario->masses.size() == 1 ? "mass" : "masses",
                             stepper ? "driven by steppers" : to_string(scenario->run.actuation),
                             sim::number_text(scenario->duration_s), sim::number_text(scenario->run.control_period_s),
                             std::isinf(friction) ? "infinite" : sim::number_text(friction),
                             real_floor_text(scenario->surface), belief_text(*scenario));
    return program::kExitCompleted;
  };
}

}  // namespace ballast
