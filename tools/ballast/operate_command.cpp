// ballast operate: sends an operator's command to the controller on a bus.
#include <iostream>
#include <memory>
#include <optional>

#include "tools/ballast/bus_words.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/go_command.h"
#include "tools/ballast/live_courses.h"
#include "tools/go/go_plan.h"
#include "tools/program/program.h"
#include "tools/recording/receive_buffer.h"
#include "tools/summary/controller_words.h"

namespace ballast {

namespace {

using firmware::OperatorCommand;

struct OperateCommand {
  std::string command;
  GoCommand go;
};

OperatorCommand command_of(const std::string& word) {
  if (word == "arm") return OperatorCommand::kArm;
  if (word == "start") return OperatorCommand::kStart;
  if (word == "stop") return OperatorCommand::kStop;
  if (word == "halt") return OperatorCommand::kHalt;
  if (word == "reset") return OperatorCommand::kReset;
  return OperatorCommand::kNone;  // status
}

// Says how far the ball will still roll, once the controller knows, and waits for the end of the halt.
std::optional<int> follow_halt(sil::BusOperator& end) {
  const auto over = [](const controller_status_t& s) {
    return s.mode != controller_status_t::MODE_HALTING && s.mode != controller_status_t::MODE_STOPPING;
  };
  if (end.follow([&](const controller_status_t& s) { return s.halt_said != 0 || over(s); }) != hal::Status::kOk) {
    return bus_trouble(end);
  }
  if (end.status().halt_said != 0) {
    std::cout << sil::halt_text(end.status()) << std::endl;
  }
  if (end.follow(over) != hal::Status::kOk) return bus_trouble(end);
  const std::string refusal = sil::refusal_text(end.status(), nullptr);
  if (!refusal.empty()) return refuse("the controller refuses the halt: " + refusal);
  return std::nullopt;
}

// Empty, or the option that does not belong to the command.
std::string stray_option(const OperateCommand& command) {
  if (command.command == "go")
    return command.go.to.empty() ? "go: --to X,Y is missing; allowed: a place in m, such as --to 0.6,-0.2" : "";
  const GoCommand none;
  const bool stray = !command.go.to.empty() || !command.go.via.empty() || command.go.duration_s ||
                     command.go.objective != none.objective || command.go.wait ||
                     command.go.time_limit_s != none.time_limit_s;
  return stray ? command.command + ": --to, --via, --time, --objective, --time-limit and --wait belong to go" : "";
}

int operate(const OperateCommand& command) {
  if (const std::string why = stray_option(command); !why.empty()) return refuse(why);
  if (command.command == "go") return go_on_bus(command.go);
  hal::Bus bus(with_receive_buffer(command.go.bus.url), program::catch_signals());
  if (!bus.good()) return program::refuse_bus("ballast", command.go.bus.url);
  sil::BusOperator end(bus, hal::Seconds(command.go.bus.peer_timeout_s));
  std::optional<plant_state_t> plant;
  bus.subscribe<plant_state_t>(hal::kChannelPlantState, [&plant](const plant_state_t& m) { plant = m; });
  LiveCourses courses;
  bus.subscribe<operator_t>(hal::kChannelCourse, [&courses](const operator_t& m) { courses.take(m); });
  if (end.connect() != hal::Status::kOk) return bus_trouble(end);
  const OperatorCommand sent = command_of(command.command);
  if (sent != OperatorCommand::kNone) {
    if (const auto exit_status = tell(end, sent, command.command)) return *exit_status;
  }
  if (end.status().mode == controller_status_t::MODE_STOPPING && sent == OperatorCommand::kStop) {
    const std::int64_t plan_tick = end.status().plan_tick;
    const auto predicted = [&](const controller_status_t& s) { return s.planned != 0 || s.plan_tick != plan_tick; };
    if (end.follow(predicted) != hal::Status::kOk) return bus_trouble(end);
    std::cout << "stopping, " << sil::plan_text(end.status()) << std::endl;
    const auto stopped = [](const controller_status_t& s) { return s.mode != controller_status_t::MODE_STOPPING; };
    if (end.follow(stopped) != hal::Status::kOk) return bus_trouble(end);
  }
  if (end.status().mode == controller_status_t::MODE_ARMED && sent == OperatorCommand::kHalt) {
    std::cout << "the ball is at rest already\n";
  }
  if (end.status().mode == controller_status_t::MODE_HALTING && sent == OperatorCommand::kHalt) {
    if (const auto exit_status = follow_halt(end)) return *exit_status;
  }
  // A robot has no plant to be heard, and nobody who repeats its courses. A run repeats them in turn.
  constexpr hal::Seconds kPlant{0.2}, kCourses{1};
  const auto start = hal::WallClock::now();
  const auto followed = [&] { return courses.path(end.status().course); };
  (void)bus.receive_until(hal::after(start, kPlant), [&plant] { return plant.has_value(); });
  if (plant && end.status().course != 0)
    (void)bus.receive_until(hal::after(start, kCourses), [&] { return followed() != nullptr; });
  const controller_status_t& status = end.status();
  std::cout << sil::status_text(status, plant ? &*plant : nullptr);
  if (followed() != nullptr) {
    const auto& goal_m = followed()->back();
    std::cout << ", its course ends at " << go::place_text({goal_m[0], goal_m[1]});
  }
  std::cout << "\n";
  return status.mode == controller_status_t::MODE_TRIPPED ? program::kExitEnvelope : program::kExitCompleted;
}

}  // namespace

std::function<int()> add_operate_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("operate",
                               "Commands the controller on a bus to arm, start, go to a place, stop, halt or reset");
  auto options = std::make_shared<OperateCommand>();
  command
      ->add_option(
          "COMMAND", options->command,
          "arm, start (the scenario's motion), go (to a place), stop, halt (the ball) or reset; status only asks")
      ->required()
      ->check(program::one_of({"status", "arm", "start", "go", "stop", "halt", "reset"}));
  add_go_options(*command, options->go);
  program::add_bus_options(*command, options->go.bus);
  command->remove_option(command->get_option("--start-timeout"));  // the run has already started
  return [options] { return operate(*options); };
}

}  // namespace ballast
