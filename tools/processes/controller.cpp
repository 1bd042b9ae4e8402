// ballast-controller: the firmware as a process of its own, over LCM.
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <type_traits>

#include "hal/control_loop.h"
#include "tools/faults/faulty_board.h"
#include "tools/program/params.h"
#include "tools/program/program.h"

int main(int argc, char** argv) {
  using namespace ballast;
  using hal::Status;

  CLI::App app{"Runs the firmware as a process of its own, over LCM.", "ballast-controller"};
  program::ScenarioOptions scenario_options;
  program::BusOptions bus_options;
  program::add_scenario_options(app, scenario_options);
  program::add_bus_options(app, bus_options);
  if (const auto exit_status = program::parse(app, argc, argv)) return *exit_status;
  const auto scenario = program::load_scenario(scenario_options);
  if (!scenario) return program::kExitUsage;
  if (scenario->run.actuation == sim::Actuation::kPrescribed) {
    program::complain(
        "ballast-controller",
        scenario->name + " is prescribed: there is no controller in a prescribed run (try --actuation stepper)");
    return program::kExitUsage;
  }
  const auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto refusal = program::to_controller_params(*scenario, *params)) {
    program::complain("ballast-controller", *refusal);
    return program::kExitUsage;
  }

  hal::Bus bus(bus_options.url, program::catch_signals());
  if (!bus.good()) return program::refuse_bus("ballast-controller", bus_options.url);
  const bool link_faults = sil::has_link_faults(*scenario);
  const hal::LcmBoardOptions options{.scenario_id = scenario->id,
                                     .control_period_s = scenario->run.control_period_s,
                                     .start_timeout = hal::Seconds(bus_options.start_timeout_s),
                                     .peer_timeout = hal::Seconds(bus_options.peer_timeout_s),
                                     .verdicts_name_their_tick = !link_faults};
  const auto serve = [&](auto& board) {
    const auto loop = std::make_unique<hal::ControlLoop<std::remove_reference_t<decltype(board)>>>(*params, board);
    const Status status = loop->run();
    if (status == Status::kEnded) return program::kExitCompleted;
    std::string why = board.trouble();
    if (status == Status::kInterrupted) why = program::interruption();
    if (status == Status::kIo) why = "the LCM bus " + bus_options.url + " failed";
    program::complain("ballast-controller", why);
    return program::kExitCouldNotRun;
  };
  if (link_faults) {
    sil::FaultyBoard board(bus, options, *scenario);
    return serve(board);
  }
  hal::LcmBoard board(bus, options);
  return serve(board);
}
