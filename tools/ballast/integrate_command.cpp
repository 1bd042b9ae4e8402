// ballast integrate: a prescribed run with one numerical method, or with all of them in comparison.
#include <fmt/core.h>
#include <unistd.h>

#include <iostream>
#include <memory>

#include "sim/scenario/reader.h"
#include "tools/ballast/commands.h"
#include "tools/integrators/comparison.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"
#include "tools/recording/output_dir.h"
#include "tools/summary/summary.h"

namespace ballast {

namespace {

using sim::number_text;

constexpr const char* kAll = "all";
constexpr double kMostFixedSteps = 1e8;

struct IntegrateCommand {
  program::ScenarioOptions scenario;
  std::string method = integrators::kDefaultMethod;
  integrators::Settings settings;
  std::string out;
  bool quiet = false;
};

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
    return fmt::format("{} is out of range; allowed: {} to {}", text, number_text(integrators::kLeastTolerance),
                       number_text(integrators::kMostTolerance));
  };
  return {check, ""};
}

// Empty, or why --step does not fit the methods and the run.
std::string step_refusal(const IntegrateCommand& command, const std::vector<const integrators::MethodInfo*>& methods,
                         double duration_s) {
  const double step_s = command.settings.fixed_step_s;
  if (!(step_s > 0)) return "";
  if (methods.size() == 1 && methods.front()->fixed_steps == integrators::FixedSteps::kNever)
    return fmt::format("--step: {} chooses its steps itself, by --tolerance", command.method);
  if (step_s > duration_s) {
    return fmt::format("--step: {} is longer than the run; allowed: <= duration = {}", number_text(step_s),
                       number_text(duration_s));
  }
  if (duration_s / step_s > kMostFixedSteps) {
    return fmt::format("--step: {} is more than {} steps in this run; allowed: at least {}", number_text(step_s),
                       number_text(kMostFixedSteps), number_text(duration_s / kMostFixedSteps));
  }
  return "";
}

int integrate(IntegrateCommand command) {
  command.scenario.actuation = "prescribed";
  const auto scenario = program::load_scenario(command.scenario);
  if (!scenario) return program::kExitUsage;
  if (!scenario->faults.empty()) {
    return refuse(to_string(scenario->faults.front()) + ": not with ballast integrate; allowed: ballast run");
  }
  if (!scenario->surface.patches.empty()) {
    return refuse(
        "surface.patch: not with ballast integrate, whose floor is everywhere the same; allowed: ballast run");
  }
  if (const auto how = integrators::why_not_rolling(*scenario); !how.empty()) {
    return refuse(fmt::format("{} starts {}; ballast integrate simulates rolling only, ballast run every regime",
                              scenario->name, how));
  }

  std::vector<const integrators::MethodInfo*> methods;
  for (const auto& method : integrators::all_methods()) {
    if (command.method == kAll || command.method == method.name) methods.push_back(&method);
  }
  if (const auto why = step_refusal(command, methods, scenario->duration_s); !why.empty()) return refuse(why);

  sil::OutputDir output(command.out.empty() ? "runs/" + scenario->name + "-integrate" : command.out);
  if (!output.good()) return could_not(output.error());
  output.clear();

  const volatile std::sig_atomic_t* interrupted = program::catch_signals();
  command.settings.interrupted = interrupted;
  // A sign of life on a terminal: all methods together take seconds.
  const bool watched = !command.quiet && methods.size() > 1 && isatty(STDERR_FILENO) == 1;
  const auto comparison = integrators::compare(*scenario, methods, command.settings, [&](const auto& method) {
    if (watched) fmt::print(stderr, "\r\033[K{} ...", method.name);
  });
  if (watched) fmt::print(stderr, "\r\033[K");
  if (*interrupted != 0) return could_not("interrupted; no results are written");
  if (!output.write("integrators.json", integrators::comparison_json(comparison))) return could_not(output.error());
  // With several methods the summary is the default one's.
  const integrators::Row* shown = &comparison.rows.front();
  std::string failures;
  for (const auto& row : comparison.rows) {
    if (std::string(row.method->name) == integrators::kDefaultMethod) shown = &row;
    if (row.run.failure.empty()) continue;
    failures += fmt::format("{}{} failed at t = {} s: {}", failures.empty() ? "" : "\n", row.method->name,
                            program::short_time(row.run.result.final_sample.time_s), row.run.failure);
  }
  const sil::RunResult& result = shown->run.result;
  if (shown->run.failure.empty() && !output.write_summary(sil::summary_json(*scenario, result)))
    return could_not(output.error());
  if (!command.quiet) {
    if (shown->run.failure.empty()) std::cout << sil::summary_text(*scenario, result, output.path());
    std::cout << integrators::comparison_text(comparison) << std::flush;
  }
  for (const auto& row : comparison.rows) {
    if (const std::string coarse = integrators::coarse_text(row); !coarse.empty()) program::complain("ballast", coarse);
  }
  if (!failures.empty()) return could_not(failures);
  return sil::exit_status(result);
}

}  // namespace

std::function<int()> add_integrate_command(CLI::App& app, CLI::App*& command) {
  command =
      app.add_subcommand("integrate", "Simulates a scenario's prescribed motion with a numerical method of choice");
  auto options = std::make_shared<IntegrateCommand>();
  program::add_scenario_options(*command, options->scenario);
  // There are no motors here, and no random numbers.
  command->remove_option(command->get_option("--actuation"));
  command->remove_option(command->get_option("--seed"));
  command->add_option("--method", options->method, "the method, or all of them in comparison")
      ->check(program::one_of(method_names()))
      ->capture_default_str();
  command->add_option("--tolerance", options->settings.tolerance, "relative and absolute tolerance of a step's error")
      ->check(tolerance_range())
      ->capture_default_str();
  command
      ->add_option("--step", options->settings.fixed_step_s,
                   "fixed step length in s, for rk4 (default: chosen by the tolerance), dopri5, dop853, radau5, "
                   "radau5_dae; with --method all only for rk4")
      ->check(program::positive_finite());
  command->add_option("--out", options->out, "folder for the results; default runs/NAME-integrate")
      ->check(program::not_empty());
  command->add_flag("--quiet", options->quiet, "no summary");
  return [options] { return integrate(*options); };
}

}  // namespace ballast
