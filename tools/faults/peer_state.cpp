#include "tools/faults/peer_state.h"

namespace ballast::sil {

using sim::FaultKind;

PeerState PeerFaultClock::advance(double time_s) {
  PeerState state;
  for (const sim::Fault& fault : scenario_.faults) {
    if (!fault.of(sim::FaultLayer::kPeer) || fault.peer != peer_ || !fault.begun(time_s)) continue;
    if (fault.kind == FaultKind::kPeerKilled) state.killed = true;
    if (fault.kind == FaultKind::kPeerFrozen && fault.active(time_s)) state.frozen = true;
    if (fault.kind == FaultKind::kPeerRestarted && !fault.begun(before_s_)) state.restarted = true;
    if (fault.kind == FaultKind::kPeerTooSlow && fault.active(time_s)) {
      state.slow_ticks += static_cast<std::int64_t>(fault.value);
    }
  }
  before_s_ = time_s;
  return state;
}

}  // namespace ballast::sil
