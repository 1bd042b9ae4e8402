// The scenario's faults of peers, injected into processes: they are killed, stopped and started again at the ticks of
// the faults. Over a bus the plant waits for its peers, and simulated time with it. So how long a peer is frozen or
// slow is measured on the wall clock, and the peer is lost when that is longer than the peer timeout.
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

  struct Restarted {
    bool controller = false, monitor = false;
  };
  // Call before the plant sends a tick's messages. Returns the peers started again.
  Restarted strike(std::int64_t tick);
  // Call while the plant waits: wakes the peers whose time has come. Returns a line about a peer that has ended, as
  // Children::ended(), with the faults that have struck; or one about a peer that could not be started again.
  std::string look();

 private:
  using Clock = std::chrono::steady_clock;

  const sim::Scenario& scenario_;
  Children& children_;
  std::map<sim::FaultPeer, Clock::time_point> asleep_until_;  // the later of two faults counts
  std::string injected_;                                      // "peer_killed at 2 s: the controller"
  std::string trouble_;
};

// The peers of a run in three processes, with the faults that strike them.
class FaultyProcesses final : public sil::Peer {
 public:
  // Both must outlive it.
  FaultyProcesses(sil::LcmPeers& peers, PeerFaults& faults) : peers_(peers), faults_(faults) {}

  hal::Status connect() override { return peers_.connect(); }
  hal::Status send(sil::Lap& lap) override;
  hal::Status receive(sil::Lap& lap) override { return peers_.receive(lap); }
  [[nodiscard]] std::string trouble() const override { return peers_.trouble(); }
  [[nodiscard]] sil::RefusedMessages refused() const override { return peers_.refused(); }

 private:
  sil::LcmPeers& peers_;
  PeerFaults& faults_;
};

}  // namespace ballast
