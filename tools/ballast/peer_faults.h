// Injects the scenario's peer faults into processes: kills, stops and restarts them at the ticks of the faults. Over a
// bus the plant, and simulated time with it, waits for its peers. So the time for which a peer is frozen or slow is
// measured on the wall clock, and a peer is lost if it exceeds the peer timeout.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>

#include "sim/scenario/scenario.h"
#include "tools/ballast/children.h"
#include "tools/sil/lcm_peers.h"

namespace ballast {

class PeerFaults {
 public:
  // Both must outlive it.
  PeerFaults(const sim::Scenario& scenario, Children& children) : scenario_(scenario), children_(children) {}

  [[nodiscard]] static bool any(const sim::Scenario& scenario);
  static const char* program_of(sim::FaultPeer peer);

  // Injects the faults of a tick, before the plant publishes.
  sil::LcmPeersOptions::StartedAnew strike(std::int64_t tick);
  // Called while the plant waits: resumes peers whose time has come. Returns a line about a peer that has ended or
  // could not be restarted, with the injected faults, or an empty one.
  std::string look();

 private:
  using Clock = std::chrono::steady_clock;

  const sim::Scenario& scenario_;
  Children& children_;
  std::map<sim::FaultPeer, Clock::time_point> asleep_until_;  // the later of two faults counts
  std::string injected_;                                      // "peer_killed at 2 s: the controller"
  std::string trouble_;
};

}  // namespace ballast
