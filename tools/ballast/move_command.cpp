// ballast move: moves masses to positions, and shows the effect on the ball.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>

#include "sim/scenario/reader.h"
#include "tools/ballast/bus_words.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/longest_move.h"
#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/program/short_number.h"
#include "tools/recording/record_run.h"
#include "tools/summary/controller_words.h"

namespace ballast {

namespace {

using program::short_number;
using program::short_time;

struct MoveCommand {
  program::ScenarioOptions scenario;
  program::BusOptions bus;
  CLI::Option* url = nullptr;
  std::vector<int> masses;
  std::vector<double> targets;
  std::optional<double> all;
  double speed_fraction = 1;
  bool force = false;  // also a move that is too long, or that cannot be predicted to its end
  std::string out;
  sil::RecordOptions record;
};

// Empty, or why a move of this duration is not made. `scenario_s`: the scenario's duration; 0: it is not known.
std::string length_refusal(const MoveCommand& command, double takes_s, double scenario_s) {
  const double most_s = longest_move_s(scenario_s);
  if (command.force || takes_s <= most_s) return "";
  // A duration goes with the reciprocal of the speed.
  const double enough = std::ceil(100 * command.speed_fraction * takes_s / most_s) / 100;
  return fmt::format(
      "the move takes {} s; allowed: at most {} s, or the scenario's duration where that is longer (--set "
      "duration=...), or with --force; a shorter move{} takes less",
      short_time(takes_s), sim::number_text(most_s),
      enough <= 1 ? fmt::format(", or --speed-fraction {:g}", enough) : "");
}

// Advice to somebody whose move is too slow to be predicted.
const char* faster_or_shorter(const MoveCommand& command) {
  return command.speed_fraction < 1 ? "a greater --speed-fraction, or several shorter moves" : "several shorter moves";
}

// Empty, or why a move is not made that has been predicted as far as it can be. A prediction that ends where the
// envelope is broken says what will happen, so it is none. `instead` is a move that would be made.
std::string prediction_refusal(const MoveCommand& command, const firmware::Prediction& plan,
                               const sim::Scenario::Envelope& envelope, const std::string& instead) {
  const bool broken = !sil::breach_text(plan, envelope.friction_use, envelope.min_normal_force_n).empty();
  if (command.force || broken || plan.horizon_s >= plan.duration_s) return "";
  return fmt::format(
      "the controller can predict only the first {} s of this move's {} s: it has a limited number of steps, which are "
      "short where the ball may swing fast; allowed: {}, or this move with --force",
      short_time(plan.horizon_s), short_time(plan.duration_s), instead);
}

// The request for a robot of `count` masses. nullopt: a mass does not exist, which is printed.
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
      program::complain("ballast",
                        fmt::format("--mass {}: {} has {} {}{}", i, whose, count, count == 1 ? "mass" : "masses",
                                    count == 0 ? "" : fmt::format("; allowed: 0..{}", count - 1)));
      return std::nullopt;
    }
    if (std::count(command.masses.begin(), command.masses.end(), i) > 1) {
      program::complain("ballast", fmt::format("--mass {}: is given more than once; allowed: one --to per mass", i));
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
    program::complain("ballast", fmt::format("only the first {} s of the move's {} s are predicted",
                                             short_time(plan.horizon_s), short_time(plan.duration_s)));
  }
}

// The distance left by the commanded positions: "mass 1 is at 2.1 (asked: 2.5, 0.4 to go)".
std::string way_to_go_text(const firmware::MoveRequest& request, const controller_status_t& status) {
  std::string text;
  for (int i = 0; i < status.motor_count; ++i) {
    if ((request.masses >> i & 1u) == 0) continue;
    const double target = request.target_position[static_cast<std::size_t>(i)], position = status.commanded_position[i];
    text += fmt::format("{}mass {} is at {} (asked: {}, {} to go)", text.empty() ? "" : ", ", i, short_number(position),
                        sim::number_text(target), short_number(target - position));
  }
  return text;
}

// Takes back a move that has just been asked for. Returns the exit status; prints `why`.
int take_back(sil::BusOperator& end, const std::string& why) {
  if (const auto exit_status = tell(end, firmware::OperatorCommand::kStop, "stop of the move")) {
    program::complain("ballast", why);
    return *exit_status;
  }
  const auto stopped = [](const controller_status_t& s) { return s.mode != controller_status_t::MODE_STOPPING; };
  const bool moved = end.status().mode == controller_status_t::MODE_STOPPING;
  if (end.follow(stopped) != hal::Status::kOk) return bus_trouble(end);
  return refuse(why + (moved ? "; it had begun, and is stopped" : ""));
}

// Moves the masses of a run on a bus.
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
  const std::string too_long =
      length_refusal(command, end.status().plan_duration_s, scenario ? scenario->duration_s : 0);
  if (!too_long.empty()) return take_back(end, too_long);
  const auto begins = [](const controller_status_t& s) { return s.mode != controller_status_t::MODE_PENDING; };
  hal::Status followed = end.follow(begins);
  const bool moving = followed == hal::Status::kOk && end.status().planned != 0 && end.status().plan_tick == plan_tick;
  if (moving && !command.record.quiet) std::cout << "moving, " << sil::plan_text(end.status()) << std::endl;
  // The messages do not contain the run's envelope. Without a scenario it is the default one.
  const sim::Scenario::Envelope envelope = scenario ? scenario->envelope : sim::Scenario::Envelope{};
  const firmware::Prediction plan = hal::from_message(end.status()).plan;
  if (moving) {
    if (const std::string why = prediction_refusal(command, plan, envelope, faster_or_shorter(command)); !why.empty())
      return take_back(end, why);
    warn_of_breach(plan, envelope);
  }
  const auto over = [](const controller_status_t& s) { return s.mode != controller_status_t::MODE_MOVING; };
  if (followed == hal::Status::kOk) followed = end.follow(over);
  const controller_status_t& status = end.status();
  if (!command.record.quiet) {
    std::cout << fmt::format("{}, at {}", sil::mode_text(status.mode), sil::positions_text(status));
    if (end.least_margin()) std::cout << "; least margin seen " + short_number(*end.least_margin());
    std::cout << std::endl;
  }
  if (moving && end.least_margin()) {
    const std::string missed = sil::far_below_text(plan, *end.least_margin());
    if (!missed.empty()) program::complain("ballast", missed);
  }
  if (followed == hal::Status::kInterrupted) {
    program::complain(
        "ballast",
        fmt::format("interrupted: the masses move on to their targets, {}; {} operate stop{} stops them",
                    way_to_go_text(*request, status), program::ballast_as_typed(), program::as_typed(command.bus)));
    return program::kExitCouldNotRun;
  }
  if (followed != hal::Status::kOk) return bus_trouble(end);
  if (status.mode == controller_status_t::MODE_ARMED && status.plan_tick == plan_tick) return program::kExitCompleted;
  const bool tripped = status.mode == controller_status_t::MODE_TRIPPED;
  program::complain("ballast", fmt::format("the move was {}: {}", tripped ? "ended by a trip" : "stopped on its way",
                                           way_to_go_text(*request, status)));
  return tripped ? program::kExitEnvelope : program::kExitCouldNotRun;
}

// The slowest of some faster moves that is predicted to its end; advice if there is none. `planned` plans
// a move.
template <class Planned>
std::string move_instead(const firmware::MoveRequest& request, const Planned& planned) {
  constexpr double kFractions[] = {0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1};
  for (const double fraction : kFractions) {
    if (fraction <= request.speed_fraction) continue;
    firmware::MoveRequest faster = request;
    faster.speed_fraction = fraction;
    const std::optional<sil::PlanRecord> move = planned(faster).move;
    if (move && move->predicted.horizon_s >= move->predicted.duration_s)
      return "--speed-fraction " + sim::number_text(fraction);
  }
  return "several shorter moves";
}

int move(const MoveCommand& command) {
  if (command.masses.size() != command.targets.size()) {
    return refuse(fmt::format("{} --mass and {} --to are given; allowed: --mass I --to X in pairs",
                              command.masses.size(), command.targets.size()));
  }
  if (command.masses.empty() && !command.all)
    return refuse("--mass: no mass is named; allowed: --mass I --to X, or --all X");
  if (command.url->count() > 0) return move_on_the_bus(command);
  if (command.scenario.scenario.empty()) return refuse("SCENARIO: is missing; allowed without it: --lcm URL");
  auto scenario = program::load_scenario(command.scenario);
  if (!scenario) return program::kExitUsage;
  if (!sim::has_controller(scenario->run.actuation)) {
    return refuse(
        scenario->name +
        " is prescribed: there is no controller to ask; allowed: --actuation stepper, where every mass is on a rail");
  }
  for (std::size_t i = 0; i < scenario->masses.size(); ++i) {
    const double velocity = scenario->masses[i].initial_velocity;
    if (velocity == 0) continue;
    return refuse(
        fmt::format("mass.{}.initial_velocity = {}: a move begins at rest; allowed: 0", i, sim::number_text(velocity)));
  }
  const auto request = request_of(command, static_cast<int>(scenario->masses.size()), scenario->name);
  if (!request) return program::kExitUsage;
  const auto params = program::make_controller_params("ballast", *scenario);
  if (!params) return program::kExitUsage;

  const auto new_peers = [&] {
    return sil::peers_in_process(*scenario, params.get(), program::to_monitor_limits(*scenario));
  };
  // A run without output plans the move first. A refused move then keeps the results of an earlier one, and the
  // prediction is printed before the move.
  const auto planned = [&](const firmware::MoveRequest& move) {
    const auto planner = new_peers();
    sil::NoRecord nowhere;
    return sil::run_with_faults(*scenario, *planner, nowhere, {.progress = {}, .move = move, .plan_only = true});
  };
  const sil::RunResult plan = planned(*request);
  if (plan.refusal) return refuse("the controller refuses the move: " + sil::refusal_text(*plan.refusal, &*request));
  if (plan.move) {
    const firmware::Prediction& predicted = plan.move->predicted;
    const std::string too_long = length_refusal(command, predicted.duration_s, scenario->duration_s);
    if (!too_long.empty()) return refuse(too_long);
    if (!prediction_refusal(command, predicted, scenario->envelope, "").empty())
      return refuse(prediction_refusal(command, predicted, scenario->envelope, move_instead(*request, planned)));
    warn_of_breach(plan.move->predicted, scenario->envelope);
  }

  sil::RecordOptions record = command.record;
  record.interrupted = program::catch_signals();
  record.move = *request;
  if (command.force) record.run_options = " --force";
  sil::OutputDir output(command.out.empty() ? "runs/" + scenario->name + "-move" : command.out);
  if (!output.good()) return could_not(output.error());
  scenario->published.clear();  // published values belong to the scenario's own motion
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
  command->remove_option(command->get_option("--start-timeout"));  // the run has already started
  options->url = command->get_option("--lcm")->description(
      "URL of the LCM bus of a run: command its controller instead of running a scenario");
  command->add_option("--mass", options->masses, "number of a mass, from 0; repeatable, each with its --to")
      ->allow_extra_args(false);
  command->add_option("--to", options->targets, "its target: rad on a circle, m on a line or spline")
      ->allow_extra_args(false);
  command->add_option("--all", options->all, "a target for all masses; --mass and --to override it for one");
  command
      ->add_option("--speed-fraction", options->speed_fraction,
                   "fraction of the greatest speed that the motors' limits allow, 0 < .. <= 1")
      ->capture_default_str();
  command->add_flag("--force", options->force,
                    "make the move even if it is longer than 600 s or cannot be predicted to its end");
  command->add_flag("--no-log", options->record.no_log, "keep no run.lcmlog");
  command->add_option("--out", options->out, "folder for the results; default runs/NAME-move")
      ->check(program::not_empty());
  command->add_flag("--quiet", options->record.quiet, "no progress bar and no summary");
  return [options] { return move(*options); };
}

}  // namespace ballast
