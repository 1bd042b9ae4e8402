// A scenario's faults, injected around a run: around its peers, its wires and its record. Time goes on whichever peer
// is silent, as it does for a robot: the controller's board has a timer of its own, and the motors stand in a tick
// without a step command. Everything follows from the scenario, its seed and the messages. The log holds each message
// as it was sent, before any fault, so it can be replayed.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "hal/lcm/bus.h"
#include "sim/scenario/scenario.h"
#include "tools/faults/faulty_firmware.h"
#include "tools/sil/run.h"

namespace ballast::sil {

// Whether a scenario has faults of messages, peers, the sensors' clock or the tick's time, which act on the peers.
// Faults of plant, sensors and disk do not.
[[nodiscard]] bool has_peer_faults(const sim::Scenario& scenario);

// The first fault that cannot be injected where the peers are, and why. Empty: all can. `where`: "with --processes".
enum class PeersAre {
  kProcesses,        // started by a program that can stop and restart them: all faults but overruns
  kProcessesByHand,  // faults of messages and the clock only
  kOutOfReach,       // none
};
[[nodiscard]] std::string cannot_inject(const sim::Scenario& scenario, PeersAre peers, const std::string& where);

// Monitor and controller in this process, with faults if the scenario has any for them. The scenario, `params`
// (accepted by firmware::validate(); null in prescribed runs) and `operator_bus` (may be null) must outlive the peers.
[[nodiscard]] std::unique_ptr<Peer> peers_in_process(const sim::Scenario& scenario,
                                                     const firmware::ControllerParams* params,
                                                     const monitor::MonitorLimits& limits,
                                                     hal::Bus* operator_bus = nullptr);

// The firmware in this process, for a replay. `before_tick`, which may be empty, must be called before each tick:
// whether the recorded controller answered in it.
struct ReplayedFirmware {
  std::unique_ptr<Peer> peer;
  std::function<void(bool answered)> before_tick;
};
[[nodiscard]] ReplayedFirmware firmware_for_replay(const sim::Scenario& scenario,
                                                   const firmware::ControllerParams& params);

// Runs as sil::run() does, with the scenario's faults of sensors, step commands and disk.
RunResult run_with_faults(const sim::Scenario& scenario, Peer& peers, LapSink& sink, RunOptions options);

}  // namespace ballast::sil
