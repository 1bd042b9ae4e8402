// ballast move: masses moved by hand, and what it does to the ball.
#include <cmath>
#include <iostream>
#include <memory>

#include "tools/ballast/commands.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/sil/in_process_peers.h"
#include "tools/sil/record_run.h"

namespace ballast {

namespace {

struct MoveCommand {
  program::ScenarioOptions scenario;
  std::vector<int> masses;
  std::vector<double> targets;
  std::optional<double> all;
  double speed_fraction = 1;
  std::string out;
  sil::RecordOptions record;
};

int refuse(const std::string& text) {
  program::complain("ballast", text);
  return program::kExitUsage;
}

int move(const MoveCommand& command) {
  if (command.masses.size() != command.targets.size()) {
    return refuse("--mass and --to: " + std::to_string(command.masses.size()) + " masses and " +
                  std::to_string(command.targets.size()) + " targets; allowed: --mass I --to X in pairs");
  }
  if (command.masses.empty() && !command.all)
    return refuse("--mass: no mass is named; allowed: --mass I --to X, or --all X");
  auto scenario = program::load_scenario(command.scenario);
  if (!scenario) return program::kExitUsage;
  if (scenario->run.actuation != sim::Actuation::kStepper) {
    return refuse(scenario->name + " is prescribed: there is no controller to ask (try --actuation stepper)");
  }
  firmware::MoveRequest request;
  request.speed_fraction = command.speed_fraction;
  const int count = static_cast<int>(scenario->masses.size());
  for (int i = 0; i < count; ++i) {
    const double velocity = scenario->masses[static_cast<std::size_t>(i)].initial_velocity;
    if (velocity != 0) {
      return refuse("mass." + std::to_string(i) + ".initial_velocity = " + std::to_string(velocity) +
                    ": a move begins at rest; allowed: 0");
    }
    if (!command.all) continue;
    request.masses |= 1u << i;
    request.target_position[static_cast<std::size_t>(i)] = *command.all;
  }
  for (std::size_t k = 0; k < command.masses.size(); ++k) {
    const int i = command.masses[k];
    if (i < 0 || i >= count) {
      return refuse("--mass " + std::to_string(i) + ": " + scenario->name + " has " + std::to_string(count) +
                    " masses; allowed: 0.." + std::to_string(count - 1));
    }
    request.masses |= 1u << i;
    request.target_position[static_cast<std::size_t>(i)] = command.targets[k];
  }
  auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto refusal = program::to_controller_params(*scenario, *params)) return refuse(*refusal);

  sil::RecordOptions record = command.record;
  record.interrupted = program::catch_signals();
  record.move = request;
  sil::OutputDir output(command.out.empty() ? "runs/" + scenario->name + "-move" : command.out);
  if (!output.good()) {
    program::complain("ballast", output.error());
    return program::kExitCouldNotRun;
  }
  scenario->published.clear();  // it speaks of the scenario's own motion
  sil::InProcessPeers peers(params.get(), program::to_monitor_limits(*scenario), scenario->run.control_period_s);
  return sil::record_run("ballast", *scenario, peers, output, record);
}

}  // namespace

std::function<int()> add_move_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand(
      "move", "Moves masses to positions and shows N, f_s and margins, instead of running the scenario's motion");
  auto options = std::make_shared<MoveCommand>();
  program::add_scenario_options(*command, options->scenario);
  command->add_option("--mass", options->masses, "a mass, counted from 0; repeatable, each with its --to")
      ->allow_extra_args(false);
  command->add_option("--to", options->targets, "its target: rad on a circle, m on a line")->allow_extra_args(false);
  command->add_option("--all", options->all, "a target for all masses; --mass and --to may differ from it");
  command
      ->add_option("--speed-fraction", options->speed_fraction,
                   "part of the greatest speed the motors' limits allow, 0 < .. <= 1")
      ->capture_default_str();
  command->add_option("--out", options->out, "folder for the results; default runs/NAME-move")
      ->check(program::not_empty());
  command->add_flag("--quiet", options->record.quiet, "no progress bar and no summary");
  return [options] { return move(*options); };
}

}  // namespace ballast
