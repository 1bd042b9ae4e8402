// ballast integrate: a prescribed run by a numerical method of one's choice, or by all of them side by side.
#include <cstdio>
#include <iostream>
#include <memory>

#include "tools/ballast/commands.h"
#include "tools/integrators/comparison.h"
#include "tools/program/program.h"
#include "tools/recording/output_dir.h"
#include "tools/summary/summary.h"

namespace ballast {

namespace {

constexpr const char* kAll = "all";
constexpr double kMostFixedSteps = 1e8;

struct IntegrateCommand {
  program::ScenarioOptions scenario;
  std::string method = integrators::kDefaultMethod;
  integrators::Settings settings;
  std::string out;
  bool quiet = false;
};

int refuse(int status, const std::string& text) {
  program::complain("ballast", text);
  return status;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.10g", value);
  return text;
}

std::vector<std::string> method_names() {
  std::vector<std::string> names;
  for (const auto& method : integrators::all_methods()) names.emplace_back(method.name);
  names.emplace_back(kAll);
  return names;
}

CLI::Validator tolerance_range() {
  const auto check = [](std::string& text) -> std::string {
    double value = 0;
    if (CLI::detail::lexical_cast(text, value) && value >= integrators::kLeastTolerance &&
        value <= integrators::kMostTolerance) {
      return {};
    }
    return text + " is out of range; allowed: " + number(integrators::kLeastTolerance) + " to " +
           number(integrators::kMostTolerance);
  };
  return {check, ""};
}

int integrate(IntegrateCommand command) {
  command.scenario.actuation = "prescribed";
  const auto scenario = program::load_scenario(command.scenario);
  if (!scenario) return program::kExitUsage;
  if (!scenario->faults.empty()) {
    return refuse(program::kExitUsage,
                  to_string(scenario->faults.front()) + ": ballast integrate knows no faults; allowed: ballast run");
  }
  if (const auto how = integrators::why_not_rolling(*scenario); !how.empty()) {
    return refuse(program::kExitUsage, scenario->name + " starts " + how +
                                           "; ballast integrate knows rolling only, ballast run every regime");
  }

  std::vector<const integrators::MethodInfo*> methods;
  for (const auto& method : integrators::all_methods()) {
    if (command.method == kAll || command.method == method.name) methods.push_back(&method);
  }
  const integrators::Settings& settings = command.settings;
  if (settings.fixed_step_s > 0) {
    if (methods.size() == 1 && methods.front()->fixed_steps == integrators::FixedSteps::kNever) {
      return refuse(program::kExitUsage, "--step: " + command.method + " chooses its steps itself, by --tolerance");
    }
    if (settings.fixed_step_s > scenario->duration_s) {
      return refuse(program::kExitUsage,
                    "--step: " + number(settings.fixed_step_s) +
                        " is longer than the run; allowed: <= duration = " + number(scenario->duration_s));
    }
    if (scenario->duration_s / settings.fixed_step_s > kMostFixedSteps) {
      return refuse(program::kExitUsage, "--step: " + number(settings.fixed_step_s) + " is more than " +
                                             number(kMostFixedSteps) + " steps in this run; allowed: at least " +
                                             number(scenario->duration_s / kMostFixedSteps));
    }
  }

  sil::OutputDir output(command.out.empty() ? "runs/" + scenario->name + "-integrate" : command.out);
  if (!output.good()) return refuse(program::kExitCouldNotRun, output.error());
  output.clear();

  const auto comparison = integrators::compare(*scenario, methods, settings);
  if (!output.write("integrators.json", integrators::comparison_json(comparison)))
    return refuse(program::kExitCouldNotRun, output.error());
  // Of all methods it is the default one that the summary is of.
  const integrators::Row* shown = &comparison.rows.front();
  std::string failures;
  for (const auto& row : comparison.rows) {
    if (std::string(row.method->name) == integrators::kDefaultMethod) shown = &row;
    if (row.run.failure.empty()) continue;
    failures += std::string(failures.empty() ? "" : "\n") + row.method->name +
                " gave up at t = " + number(row.run.result.final_sample.time_s) + " s: " + row.run.failure;
  }
  const sil::RunResult& result = shown->run.result;
  if (shown->run.failure.empty() && !output.write_summary(sil::summary_json(*scenario, result)))
    return refuse(program::kExitCouldNotRun, output.error());
  if (!command.quiet) {
    if (shown->run.failure.empty()) std::cout << sil::summary_text(*scenario, result, output.path());
    std::cout << integrators::comparison_text(comparison) << std::flush;
  }
  if (!failures.empty()) return refuse(program::kExitCouldNotRun, failures);
  return sil::exit_status(result);
}

}  // namespace

std::function<int()> add_integrate_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("integrate", "Rolls a scenario's prescribed motion by a numerical method of choice");
  auto options = std::make_shared<IntegrateCommand>();
  program::add_scenario_options(*command, options->scenario);
  // Nothing is driven here, and nothing random.
  command->remove_option(command->get_option("--actuation"));
  command->remove_option(command->get_option("--seed"));
  command->add_option("--method", options->method, "the method, or all of them side by side")
      ->check(CLI::IsMember(method_names()))
      ->capture_default_str();
  command->add_option("--tolerance", options->settings.tolerance, "relative and absolute, of each step's error")
      ->check(tolerance_range())
      ->capture_default_str();
  command
      ->add_option("--step", options->settings.fixed_step_s,
                   "s; steps of this length whatever the error: rk4 (default: what suits the tolerance), dopri5, "
                   "dop853, radau5, radau5_dae; with --method all only of rk4")
      ->check(program::positive_finite());
  command->add_option("--out", options->out, "folder for the results; default runs/NAME-integrate")
      ->check(program::not_empty());
  command->add_flag("--quiet", options->quiet, "no summary");
  return [options] { return integrate(*options); };
}

}  // namespace ballast
