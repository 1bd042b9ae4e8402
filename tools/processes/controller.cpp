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
  program::PeerOptions peer;
  if (const auto exit_status = program::parse_peer(app, argc, argv, peer)) return *exit_status;
  const sim::Scenario& scenario = *peer.scenario;
  if (!sim::has_controller(scenario.run.actuation)) {
    program::complain(
        "ballast-controller",
        scenario.name + " is prescribed: there is no controller in a prescribed run (try --actuation stepper)");
    return program::kExitUsage;
  }
  const auto params = program::make_controller_params("ballast-controller", scenario);
  if (!params) return program::kExitUsage;

  hal::Bus bus(peer.bus.url, program::catch_signals());
  if (!bus.good()) return program::refuse_bus("ballast-controller", peer.bus.url);
  const bool link_faults = sil::has_link_faults(scenario);
  const hal::LcmBoardOptions options{.scenario_id = scenario.id,
                                     .control_period_s = scenario.run.control_period_s,
                                     .start_timeout = hal::Seconds(peer.bus.start_timeout_s),
                                     .peer_timeout = hal::Seconds(peer.bus.peer_timeout_s),
                                     .verdicts_name_their_tick = !link_faults};
  const auto serve = [&](auto& board) {
    const auto loop = std::make_unique<hal::ControlLoop<std::remove_reference_t<decltype(board)>>>(*params, board);
    const Status status = loop->run();
    if (status == Status::kEnded) return program::kExitCompleted;
    std::string why = board.trouble();
    if (status == Status::kForeignScenario) why += program::kOwnBus;
    if (status == Status::kInterrupted) why = program::interruption();
    if (status == Status::kIo) why = "the LCM bus " + peer.bus.url + " failed";
    program::complain("ballast-controller", why);
    return program::kExitCouldNotRun;
  };
  if (link_faults) {
    sil::FaultyBoard board(bus, options, scenario);
    return serve(board);
  }
  hal::LcmBoard board(bus, options);
  return serve(board);
}
