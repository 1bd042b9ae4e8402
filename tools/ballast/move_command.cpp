// ballast move: masses moved by hand, and what it does to the ball.
#include <cmath>
#include <iostream>
#include <memory>

#include "tools/ballast/bus_words.h"
#include "tools/ballast/commands.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/sil/controller_words.h"
#include "tools/sil/faulty_peers.h"
#include "tools/sil/record_run.h"

namespace ballast {

namespace {

struct MoveCommand {
  program::ScenarioOptions scenario;
  program::BusOptions bus;
  CLI::Option* url = nullptr;
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

// The masses asked, of `count`; nullopt: which are not there is printed.
std::optional<firmware::MoveRequest> request_of(const MoveCommand& command, int count, const std::string& whose) {
  firmware::MoveRequest request;
  request.speed_fraction = command.speed_fraction;
  for (int i = 0; i < count && command.all; ++i) {
    request.masses |= 1u << i;
    request.target_position[static_cast<std::size_t>(i)] = *command.all;
  }
  for (std::size_t k = 0; k < command.masses.size(); ++k) {
    const int i = command.masses[k];
    if (i < 0 || i >= count) {
      program::complain("ballast", "--mass " + std::to_string(i) + ": " + whose + " has " + std::to_string(count) +
                                       (count == 1 ? " mass" : " masses") +
                                       (count == 0 ? "" : "; allowed: 0.." + std::to_string(count - 1)));
      return std::nullopt;
    }
    request.masses |= 1u << i;
    request.target_position[static_cast<std::size_t>(i)] = command.targets[k];
  }
  return request;
}

// Asks the controller of a run that is under way.
int move_on_the_bus(const MoveCommand& command) {
  if (!command.out.empty()) return refuse("--out: the run on the bus keeps its own results; allowed without --lcm");
  std::optional<sim::Scenario> scenario;
  if (!command.scenario.scenario.empty()) {
    scenario = program::load_scenario(command.scenario);
    if (!scenario) return program::kExitUsage;
  }
  hal::Bus bus(command.bus.url, program::catch_signals());
  if (!bus.good()) {
    program::complain("ballast", "cannot use the LCM bus " + command.bus.url);
    return program::kExitCouldNotRun;
  }
  sil::BusOperator end(bus, hal::Seconds(command.bus.peer_timeout_s));
  if (end.connect() != hal::Status::kOk) return bus_trouble(end);
  if (scenario && end.status().scenario_id != scenario->id) {
    return refuse("the controller on this bus runs another scenario than " + scenario->name +
                  " as given here (every --set counts); allowed: the same, or none");
  }
  const auto request = request_of(command, end.status().motor_count, "the robot on this bus");
  if (!request) return program::kExitUsage;
  if (const auto exit_status = tell(end, *request, "move")) return *exit_status;
  const std::int64_t plan_tick = end.status().plan_tick;
  if (!command.record.quiet) std::cout << "moving, " << plan_text(end.status()) << std::endl;
  const auto over = [](const controller_status_t& s) { return s.mode != controller_status_t::MODE_MOVING; };
  if (end.follow(over) != hal::Status::kOk) return bus_trouble(end);
  const controller_status_t& status = end.status();
  if (!command.record.quiet) {
    std::cout << sil::mode_text(status.mode) << ", at " << positions_text(status) << "; least margin seen "
              << end.least_margin() << '\n';
  }
  if (status.mode == controller_status_t::MODE_TRIPPED) return program::kExitEnvelope;
  if (status.mode == controller_status_t::MODE_ARMED && status.plan_tick == plan_tick) return program::kExitCompleted;
  program::complain("ballast", "the move was stopped on its way");
  return program::kExitCouldNotRun;
}

int move(const MoveCommand& command) {
  if (command.masses.size() != command.targets.size()) {
    return refuse("--mass and --to: " + std::to_string(command.masses.size()) + " masses and " +
                  std::to_string(command.targets.size()) + " targets; allowed: --mass I --to X in pairs");
  }
  if (command.masses.empty() && !command.all)
    return refuse("--mass: no mass is named; allowed: --mass I --to X, or --all X");
  if (command.url->count() > 0) return move_on_the_bus(command);
  if (command.scenario.scenario.empty()) return refuse("SCENARIO: is missing; allowed without it: --lcm URL");
  auto scenario = program::load_scenario(command.scenario);
  if (!scenario) return program::kExitUsage;
  if (scenario->run.actuation != sim::Actuation::kStepper) {
    return refuse(scenario->name + " is prescribed: there is no controller to ask (try --actuation stepper)");
  }
  for (std::size_t i = 0; i < scenario->masses.size(); ++i) {
    const double velocity = scenario->masses[i].initial_velocity;
    if (velocity == 0) continue;
    return refuse("mass." + std::to_string(i) + ".initial_velocity = " + std::to_string(velocity) +
                  ": a move begins at rest; allowed: 0");
  }
  const auto request = request_of(command, static_cast<int>(scenario->masses.size()), scenario->name);
  if (!request) return program::kExitUsage;
  auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto refusal = program::to_controller_params(*scenario, *params)) return refuse(*refusal);

  sil::RecordOptions record = command.record;
  record.interrupted = program::catch_signals();
  record.move = *request;
  sil::OutputDir output(command.out.empty() ? "runs/" + scenario->name + "-move" : command.out);
  if (!output.good()) {
    program::complain("ballast", output.error());
    return program::kExitCouldNotRun;
  }
  scenario->published.clear();  // it speaks of the scenario's own motion
  const auto peers = sil::peers_in_process(*scenario, params.get(), program::to_monitor_limits(*scenario));
  return sil::record_run("ballast", *scenario, *peers, output, record);
}

}  // namespace

std::function<int()> add_move_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand(
      "move", "Moves masses to positions and shows N, f_s and margins, instead of running the scenario's motion");
  auto options = std::make_shared<MoveCommand>();
  program::add_scenario_options(*command, options->scenario);
  command->get_option("SCENARIO")->required(false);
  program::add_bus_options(*command, options->bus);
  command->remove_option(command->get_option("--start-timeout"));  // it speaks to a run that is under way
  options->url = command->get_option("--lcm")->description(
      "URL of the LCM bus of a run that is under way: ask its controller, instead of running");
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
