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
  program::ScenarioOptions scenario_options;
  program::BusOptions bus_options;
  program::add_scenario_options(app, scenario_options);
  program::add_bus_options(app, bus_options);
  if (const auto exit_status = program::parse(app, argc, argv)) return *exit_status;
  const auto scenario = program::load_scenario(scenario_options);
  if (!scenario) return program::kExitUsage;

  hal::Bus bus(bus_options.url, program::catch_signals());
  if (!bus.good()) return program::refuse_bus("ballast-monitor", bus_options.url);
  const monitor::MonitorLimits limits = program::to_monitor_limits(*scenario);
  monitor::Monitor sound_monitor(limits);
  sil::FaultyLinksMonitor faulty_monitor(limits, *scenario);
  monitor::Monitor& monitor = sil::has_link_faults(*scenario) ? faulty_monitor : sound_monitor;
  const monitor::MonitorLoopOptions options{.control_period_s = scenario->run.control_period_s,
                                            .start_timeout = hal::Seconds(bus_options.start_timeout_s),
                                            .peer_timeout = hal::Seconds(bus_options.peer_timeout_s)};
  monitor::MonitorLoop loop(bus, monitor, limits, options);
  const Status status = loop.run();
  if (const auto refused = loop.counters().refused() + faulty_monitor.counters().refused(); refused > 0) {
    program::complain("ballast-monitor", std::to_string(refused) + " messages on the bus were not used");
  }
  if (!loop.trouble().empty()) program::complain("ballast-monitor", loop.trouble());
  if (status == Status::kInterrupted) program::complain("ballast-monitor", program::interruption());
  if (status == Status::kIo) program::complain("ballast-monitor", "the LCM bus " + bus_options.url + " failed");
  if (status != Status::kEnded) return program::kExitCouldNotRun;
  return loop.verdict().tripped == 1 ? program::kExitEnvelope : program::kExitCompleted;
}
