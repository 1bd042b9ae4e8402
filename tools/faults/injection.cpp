#include "tools/faults/injection.h"

#include <algorithm>
#include <utility>

#include "tools/faults/faulty_wires.h"
#include "tools/faults/full_disk.h"
#include "tools/sil/host_firmware.h"

namespace ballast::sil {

using sim::Fault;
using sim::FaultKind;
using sim::FaultLayer;

namespace {

bool acts_on_peers(const Fault& fault) {
  return fault.of(FaultLayer::kMessage) || fault.of(FaultLayer::kPeer) || fault.kind == FaultKind::kClockJump ||
         fault.kind == FaultKind::kControllerOverrun;
}

}  // namespace

bool has_peer_faults(const sim::Scenario& scenario) { return std::ranges::any_of(scenario.faults, acts_on_peers); }

std::string cannot_inject(const sim::Scenario& scenario, PeersAre peers, const std::string& where) {
  const auto possible = [peers](const Fault& fault) {
    if (!acts_on_peers(fault)) return true;
    if (fault.of(FaultLayer::kMessage) || fault.kind == FaultKind::kClockJump) return peers != PeersAre::kOutOfReach;
    return fault.of(FaultLayer::kPeer) && peers == PeersAre::kProcesses;
  };
  const auto fault = std::find_if_not(scenario.faults.begin(), scenario.faults.end(), possible);
  if (fault == scenario.faults.end()) return "";
  const char* allowed = fault->kind == FaultKind::kControllerOverrun ? "ballast run without --processes and --firmware"
                        : peers == PeersAre::kOutOfReach ? "ballast run without --firmware and --check-steps"
                                                         : "ballast run, with --processes or without";
  return to_string(*fault) + ": cannot be injected " + where + "; allowed: " + allowed;
}

std::unique_ptr<Peer> peers_in_process(const sim::Scenario& scenario, const firmware::ControllerParams* params,
                                       const monitor::MonitorLimits& limits, hal::Bus* operator_bus) {
  if (!has_peer_faults(scenario)) {
    return std::make_unique<InProcessPeers>(params, limits, scenario.run.control_period_s, operator_bus);
  }
  auto monitor = std::make_unique<FaultyMonitor>(scenario, limits);
  std::unique_ptr<Peer> controller;
  if (params != nullptr) controller = std::make_unique<FaultyFirmware>(scenario, *params, monitor.get());
  return std::make_unique<LocalPeers>(std::move(monitor), std::move(controller), operator_bus);
}

ReplayedFirmware firmware_for_replay(const sim::Scenario& scenario, const firmware::ControllerParams& params) {
  if (!has_peer_faults(scenario)) {
    return {std::make_unique<HostFirmware>(params, scenario.run.control_period_s), {}};
  }
  auto faulty = std::make_unique<FaultyFirmware>(scenario, params, nullptr);
  auto before_tick = [&faulty = *faulty](bool answered) { faulty.set_answers_now(answered); };
  return {std::move(faulty), before_tick};
}

RunResult run_with_faults(const sim::Scenario& scenario, Peer& peers, LapSink& sink, RunOptions options) {
  FaultyWires wires(scenario);
  FullDisk disk(scenario, sink);
  options.wires = &wires;
  return run(scenario, peers, disk, options);
}

}  // namespace ballast::sil
