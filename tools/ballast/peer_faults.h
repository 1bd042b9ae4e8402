// The scenario's faults of peers, done to processes: killed, stopped and started anew for good, at the ticks of the
// faults. Over a bus the plant waits for its peers, and simulated time with it: how long a peer is frozen or slow is
// measured on the wall clock, and it is lost when that is longer than the peer timeout.
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

  // Before the plant speaks in a tick.
  sil::LcmPeersOptions::StartedAnew strike(std::int64_t tick);
  // While it waits: lets those go on whose time has come. A line about a peer that has ended, as Children::ended(),
  // with what the scenario has done; or that one could not be started anew.
  std::string look();

 private:
  using Clock = std::chrono::steady_clock;

  const sim::Scenario& scenario_;
  Children& children_;
  std::map<sim::FaultPeer, Clock::time_point> asleep_until_;  // of two faults the later
  std::string done_;                                          // "peer_killed at 2 s: the controller"
  std::string trouble_;
};

}  // namespace ballast
