// ballast-plant: the ball as a process of its own. It sets the pace of the lockstep, plays the operator (arm, start)
// unless one is on the bus, and records.
#include <CLI/CLI.hpp>
#include <iostream>

#include "tools/faults/injection.h"
#include "tools/program/program.h"
#include "tools/recording/record_run.h"
#include "tools/recording/scenario_beacon.h"
#include "tools/sil/lcm_peers.h"

int main(int argc, char** argv) {
  using namespace ballast;

  CLI::App app{
      "Runs the plant as a process of its own, over LCM: waits for controller and monitor, then runs and records.",
      "ballast-plant"};
  program::PeerOptions peer;
  std::string out;
  sil::RecordOptions record{.unbuffered = true};
  app.add_option("--out", out, "folder for the results; default runs/NAME")->check(program::not_empty());
  app.add_option("--speed", record.speed, "simulated over wall time; default as fast as it goes")
      ->check(program::positive_finite());
  app.add_flag("--by-hand", record.by_hand,
               "arm the controller, and leave start, stop and moves to operators; give --speed 1 with it");
  app.add_flag("--quiet", record.quiet, "no progress bar and no summary");
  if (const auto exit_status = program::parse_peer(app, argc, argv, peer)) return *exit_status;
  const sim::Scenario& scenario = *peer.scenario;

  if (const std::string why =
          sil::cannot_inject(scenario, sil::PeersAre::kProcessesByHand, "in processes started by hand");
      !why.empty()) {
    program::complain("ballast-plant", why);
    return program::kExitUsage;
  }
  if (record.speed > 0 && 2 * scenario.run.control_period_s / record.speed > peer.bus.peer_timeout_s) {
    program::complain("ballast-plant",
                      "--speed: at this pace a tick takes more than half the peer timeout; give all processes a longer "
                      "--peer-timeout");
    return program::kExitUsage;
  }
  record.run_options = " --processes" + program::as_typed(peer.bus);
  record.interrupted = program::catch_signals();
  hal::Bus bus(peer.bus.url, record.interrupted);
  if (!bus.good()) return program::refuse_bus("ballast-plant", peer.bus.url);
  sil::OutputDir output(out.empty() ? "runs/" + scenario.name : out);
  if (!output.good()) {
    program::complain("ballast-plant", output.error());
    return program::kExitCouldNotRun;
  }
  const sil::LcmPeersOptions options{.scenario_id = scenario.id,
                                     .controller_expected = sim::has_controller(scenario.run.actuation),
                                     .start_timeout = hal::Seconds(peer.bus.start_timeout_s),
                                     .peer_timeout = hal::Seconds(peer.bus.peer_timeout_s),
                                     .verdicts_name_their_tick = !sil::has_link_faults(scenario)};
  sil::LcmPeers peers(bus, options);
  const sil::ScenarioBeacon beacon(peer.bus.url, options.run_id, scenario);
  return program::after_output("ballast-plant", sil::record_run("ballast-plant", scenario, peers, output, record));
}
