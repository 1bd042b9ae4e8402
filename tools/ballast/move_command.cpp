// ballast move: masses moved by hand, and what it does to the ball.
#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>

#include "sim/scenario/reader.h"
#include "tools/ballast/bus_words.h"
#include "tools/ballast/commands.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/summary/controller_words.h"
#include "tools/faults/faulty_peers.h"
#include "tools/recording/record_run.h"

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

// A run without --lcm keeps all that is said, 2.4 MB a second at 1 kHz. A move that takes longer has to be meant.
constexpr double kLongestMove_s = 600;

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
    if (std::count(command.masses.begin(), command.masses.end(), i) > 1) {
      program::complain("ballast",
                        "--mass " + std::to_string(i) + ": is given more than once; allowed: one --to a mass");
      return std::nullopt;
    }
    request.masses |= 1u << i;
    request.target_position[static_cast<std::size_t>(i)] = command.targets[k];
  }
  return request;
}

void warn_of_breach(const firmware::Prediction& plan, const sim::Scenario::Envelope& envelope) {
  const std::string breach = sil::breach_text(plan, envelope.friction_use, envelope.min_normal_force_n);
  if (!breach.empty()) {
    program::complain("ballast", "the move is predicted to break the envelope: " + breach);
  } else if (plan.horizon_s < plan.duration_s) {
    char text[192];
    std::snprintf(text, sizeof text,
                  "of the move's %.6g s only the first %.6g s are predicted: a tick has time for few steps of it, and "
                  "they are short where the ball turns fast",
                  plan.duration_s, plan.horizon_s);
    program::complain("ballast", text);
  }
}

// "mass 1 is at 2.1 (asked: 2.5, 0.4 to go)", as far as the controller knows.
std::string way_to_go_text(const firmware::MoveRequest& request, const controller_status_t& status) {
  std::string text;
  for (int i = 0; i < status.motor_count; ++i) {
    if ((request.masses >> i & 1u) == 0) continue;
    const double target = request.target_position[static_cast<std::size_t>(i)], position = status.commanded_position[i];
    char one[128];
    std::snprintf(one, sizeof one, "%smass %d is at %.6g (asked: %.6g, %.2g to go)", text.empty() ? "" : ", ", i,
                  position, target, target - position);
    text += one;
  }
  return text;
}

// Asks the controller of a run that is under way.
int move_on_the_bus(const MoveCommand& command) {
  if (!command.out.empty()) return refuse("--out: the run on the bus keeps its own results; allowed without --lcm");
  const program::ScenarioOptions& given = command.scenario;
  if (!given.fault.empty()) return refuse("--fault: the run on the bus has its own; allowed without --lcm");
  if (given.scenario.empty() && (!given.set.empty() || !given.actuation.empty() || given.seed)) {
    return refuse("--set, --actuation and --seed change a scenario, and none is given; allowed with SCENARIO");
  }
  std::optional<sim::Scenario> scenario;
  if (!given.scenario.empty()) {
    scenario = program::load_scenario(command.scenario);
    if (!scenario) return program::kExitUsage;
  }
  hal::Bus bus(command.bus.url, program::catch_signals());
  if (!bus.good()) return program::refuse_bus("ballast", command.bus.url);
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
  const auto begins = [](const controller_status_t& s) { return s.mode != controller_status_t::MODE_PENDING; };
  if (end.follow(begins) != hal::Status::kOk) return bus_trouble(end);
  const bool moving = end.status().planned != 0 && end.status().plan_tick == plan_tick;
  if (moving && !command.record.quiet) std::cout << "moving, " << plan_text(end.status()) << std::endl;
  // The bus does not say what the run allows; without a scenario it is what the ball and the floor do.
  const sim::Scenario::Envelope envelope = scenario ? scenario->envelope : sim::Scenario::Envelope{};
  const firmware::Prediction plan = hal::from_message(end.status()).plan;
  if (moving) warn_of_breach(plan, envelope);
  const auto over = [](const controller_status_t& s) { return s.mode != controller_status_t::MODE_MOVING; };
  const hal::Status followed = end.follow(over);
  const controller_status_t& status = end.status();
  if (!command.record.quiet) {
    std::cout << sil::mode_text(status.mode) << ", at " << positions_text(status);
    if (end.least_margin()) std::cout << "; least margin seen " << *end.least_margin();
    std::cout << std::endl;
  }
  if (moving && end.least_margin()) {
    const std::string missed = sil::far_below_text(plan, *end.least_margin());
    if (!missed.empty()) program::complain("ballast", missed);
  }
  if (followed == hal::Status::kInterrupted) {
    program::complain("ballast", "interrupted: the masses go on to where they were sent, " +
                                     way_to_go_text(*request, status) + "; " + program::ballast_as_typed() +
                                     " operate stop" + program::as_typed(command.bus) + " stops them");
    return program::kExitCouldNotRun;
  }
  if (followed != hal::Status::kOk) return bus_trouble(end);
  if (status.mode == controller_status_t::MODE_ARMED && status.plan_tick == plan_tick) return program::kExitCompleted;
  const bool tripped = status.mode == controller_status_t::MODE_TRIPPED;
  program::complain("ballast", std::string("the move was ") + (tripped ? "ended by a trip" : "stopped on its way") +
                                   ": " + way_to_go_text(*request, status));
  return tripped ? program::kExitEnvelope : program::kExitCouldNotRun;
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
    return refuse(
        scenario->name +
        " is prescribed: there is no controller to ask; allowed: --actuation stepper, where every mass is on a rail");
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

  const auto new_peers = [&] {
    return sil::peers_in_process(*scenario, params.get(), program::to_monitor_limits(*scenario));
  };
  // Asked first without a trace: what a refused move would replace stays, and what it will do is said before it does
  // it.
  const auto planner = new_peers();
  sil::Recorder nowhere("/dev/null");
  const sil::RunResult plan =
      sil::run(*scenario, *planner, nowhere, {.progress = {}, .move = *request, .plan_only = true});
  if (!plan.refusal.empty()) return refuse("the controller refuses the move: " + plan.refusal);
  if (plan.move) {
    const double most_s = std::max(kLongestMove_s, scenario->duration_s), takes_s = plan.move->predicted.duration_s;
    if (takes_s > most_s) {
      return refuse("so far a move, or so slow a one (--speed-fraction), takes " + sim::number_text(takes_s) +
                    " s; allowed: at most " + sim::number_text(most_s) +
                    " s, or the scenario's duration where that is longer (--set duration=...)");
    }
    warn_of_breach(plan.move->predicted, scenario->envelope);
  }

  sil::RecordOptions record = command.record;
  record.interrupted = program::catch_signals();
  record.move = *request;
  sil::OutputDir output(command.out.empty() ? "runs/" + scenario->name + "-move" : command.out);
  if (!output.good()) {
    program::complain("ballast", output.error());
    return program::kExitCouldNotRun;
  }
  scenario->published.clear();  // it speaks of the scenario's own motion
  const auto peers = new_peers();
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
  command->add_option("--to", options->targets, "its target: rad on a circle, m on a line or spline")
      ->allow_extra_args(false);
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
