// ballast check: lists every error in a scenario, or describes the scenario.
#include <fmt/core.h>

#include <cmath>
#include <iostream>
#include <memory>

#include "tools/ballast/commands.h"
#include "tools/program/params.h"
#include "tools/program/program.h"

namespace ballast {

std::function<int()> add_check_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("check", "Validates a scenario and lists every error in it");
  auto options = std::make_shared<program::ScenarioOptions>();
  program::add_scenario_options(*command, *options);
  return [options] {
    const auto scenario = program::load_scenario(*options);
    if (!scenario) return program::kExitUsage;
    const bool stepper = scenario->run.actuation == sim::Actuation::kStepper;
    if (stepper) {
      auto params = std::make_unique<firmware::ControllerParams>();
      if (const auto refusal = program::to_controller_params(*scenario, *params)) {
        program::complain("ballast", *refusal);
        return program::kExitUsage;
      }
    }
    const double mu_s = scenario->surface.static_friction;
    std::cout << fmt::format("{}: good. {} {}, {}, {:g} s in ticks of {:g} s, mu_s {}\n", scenario->name,
                             scenario->masses.size(), scenario->masses.size() == 1 ? "mass" : "masses",
                             stepper ? "driven by steppers" : "prescribed", scenario->duration_s,
                             scenario->run.control_period_s, std::isinf(mu_s) ? "infinite" : fmt::format("{:g}", mu_s));
    return program::kExitCompleted;
  };
}

}  // namespace ballast
