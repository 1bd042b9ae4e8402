// ballast-monitor: judges a run over LCM, tick by tick.
#include <CLI/CLI.hpp>
#include <iostream>

#include "tools/faults/faulty_monitor.h"
#include "tools/monitor/monitor_loop.h"
#include "tools/program/params.h"
#include "tools/program/program.h"

int main(int argc, char** argv) {
  using namespace ballast;
  using hal::Status;

  CLI::App app{"Watches the ball's performance envelope over LCM and trips when it is left.", "ballast-monitor"};
  program::PeerOptions peer;
  if (const auto exit_status = program::parse_peer(app, argc, argv, peer)) return *exit_status;
  const sim::Scenario& scenario = *peer.scenario;

  hal::Bus bus(peer.bus.url, program::catch_signals());
  if (!bus.good()) return program::refuse_bus("ballast-monitor", peer.bus.url);
  const monitor::MonitorLimits limits = program::to_monitor_limits(scenario);
  monitor::Monitor monitor(limits);
  sil::FaultyLinksToMonitor links(monitor, scenario);
  monitor::MonitorLoopOptions options{.control_period_s = scenario.run.control_period_s,
                                      .start_timeout = hal::Seconds(peer.bus.start_timeout_s),
                                      .peer_timeout = hal::Seconds(peer.bus.peer_timeout_s)};
  if (sil::has_link_faults(scenario)) options.judge = [&](const monitor::Samples& samples) { links.judge(samples); };
  monitor::MonitorLoop loop(bus, monitor, limits, options);
  const Status status = loop.run();
  if (const auto refused = loop.counters().refused() + links.counters().refused(); refused > 0) {
    program::complain("ballast-monitor",
                      std::to_string(refused) +
                          (refused == 1 ? " message on the bus was not used" : " messages on the bus were not used"));
  }
  const char* advice = status == Status::kForeignScenario ? program::kOwnBus : "";
  if (!loop.trouble().empty()) program::complain("ballast-monitor", loop.trouble() + advice);
  if (status == Status::kInterrupted) program::complain("ballast-monitor", program::interruption());
  if (status == Status::kIo) program::complain("ballast-monitor", "the LCM bus " + peer.bus.url + " failed");
  if (status != Status::kEnded) return program::kExitCouldNotRun;
  return loop.verdict().tripped == 1 ? program::kExitEnvelope : program::kExitCompleted;
}
