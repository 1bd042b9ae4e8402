// ballast friction: how much friction a scenario needs, when, and which mass causes it.
#include <iostream>
#include <memory>

#include "tools/ballast/commands.h"
#include "tools/program/program.h"
#include "tools/summary/friction_run.h"
#include "tools/summary/summary.h"

namespace ballast {

namespace {

int print_required_friction(const program::ScenarioOptions& options) {
  auto scenario = program::load_scenario(options);
  if (!scenario) return program::kExitUsage;
  const sil::FrictionRun run = sil::run_for_friction(std::move(*scenario), program::catch_signals());
  if (!run.refusal.empty()) return refuse(run.refusal);
  if (run.result.status != hal::Status::kOk) return could_not(run.result.trouble);
  std::cout << sil::friction_run_text(run);
  return sil::exit_status(run.result);
}

}  // namespace

std::function<int()> add_friction_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("friction", "Prints how much friction a scenario needs, when, and which mass causes it");
  auto options = std::make_shared<program::ScenarioOptions>();
  program::add_scenario_options(*command, *options);
  command->get_option("--fault")->group("");  // hidden in the help; refused with a reason
  return [options] { return print_required_friction(*options); };
}

}  // namespace ballast
