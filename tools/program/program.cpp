#include "tools/program/program.h"

#include <iostream>

namespace ballast::program {
namespace {

volatile std::sig_atomic_t caught_signal = 0;

void on_signal(int number) { caught_signal = number; }

}  // namespace

void add_scenario_options(CLI::App& app, ScenarioOptions& options) {
  app.add_option("SCENARIO", options.scenario, "a scenario file, or the name of a scenario that ships")->required();
  app.add_option("--set", options.set, "KEY=VALUE: replaces a value of the scenario, e.g. mass.2.mass=60; repeatable")
      ->allow_extra_args(false);  // otherwise it would swallow SCENARIO
  app.add_option("--actuation", options.actuation, "prescribed or stepper, instead of what the scenario says")
      ->check(CLI::IsMember({"prescribed", "stepper"}));
  app.add_option("--seed", options.seed, "seed of all random numbers, instead of the scenario's");
}

void add_bus_options(CLI::App& app, BusOptions& options) {
  app.add_option("--lcm", options.url, "URL of the LCM bus")->capture_default_str();
  app.add_option("--start-timeout", options.start_timeout_s, "seconds to wait for the first tick")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  app.add_option("--peer-timeout", options.peer_timeout_s, "seconds of silence after which a peer is lost")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
}

std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitCompleted : kExitUsage;
  }
  return std::nullopt;
}

std::optional<sim::Scenario> load_scenario(const ScenarioOptions& options) {
  const std::filesystem::path file = sim::find_scenario(options.scenario, BALLAST_SCENARIO_DIR);
  if (file.empty()) {
    std::cerr << options.scenario << ": neither a file nor the name of a scenario that ships in "
              << BALLAST_SCENARIO_DIR << '\n';
    return std::nullopt;
  }
  std::vector<std::string> overrides = options.set;
  if (!options.actuation.empty()) overrides.push_back("run.actuation=" + options.actuation);
  if (options.seed) overrides.push_back("seed=" + std::to_string(*options.seed));
  sim::ScenarioResult result = sim::read_scenario(file, overrides);
  for (const sim::ScenarioError& error : result.errors) std::cerr << sim::to_string(error) << '\n';
  if (!result.ok()) return std::nullopt;
  return std::move(result.scenario);
}

void complain(const std::string& program_name, const std::string& text) {
  std::cerr << program_name + ": " + text + "\n";
}

const volatile std::sig_atomic_t* catch_signals() {
  struct sigaction action {};
  action.sa_handler = on_signal;  // no SA_RESTART: waiting calls return
  for (const int number : {SIGINT, SIGTERM}) sigaction(number, &action, nullptr);
  return &caught_signal;
}

}  // namespace ballast::program
