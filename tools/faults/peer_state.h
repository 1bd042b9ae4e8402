// The scenario's faults of one peer, tick by tick.
#pragma once

#include <cstdint>

#include "sim/scenario/scenario.h"

namespace ballast::sil {

struct PeerState {
  bool killed = false, frozen = false;
  bool restarted = false;  // in this tick
  std::int64_t slow_ticks = 0;

  [[nodiscard]] bool works() const { return !killed && !frozen; }
};

class PeerFaultClock {
 public:
  // The scenario must outlive the clock.
  PeerFaultClock(const sim::Scenario& scenario, sim::FaultPeer peer) : scenario_(scenario), peer_(peer) {}
  // Once per tick, in order.
  PeerState advance(double time_s);

 private:
  const sim::Scenario& scenario_;
  sim::FaultPeer peer_;
  double before_s_ = -1;  // time of the tick before
};

}  // namespace ballast::sil
