#include "tools/ballast/peer_faults.h"

#include <signal.h>

#include <algorithm>
#include <cmath>

#include "tools/faults/faulty_link.h"

namespace ballast {

using sim::Fault;
using sim::FaultKind;
using sim::FaultLayer;
using sim::FaultPeer;

bool PeerFaults::any(const sim::Scenario& scenario) {
  return std::ranges::any_of(scenario.faults, [](const Fault& fault) { return fault.of(FaultLayer::kPeer); });
}

const char* PeerFaults::program_of(FaultPeer peer) {
  return peer == FaultPeer::kController ? "ballast-controller" : "ballast-monitor";
}

PeerFaults::Restarted PeerFaults::strike(std::int64_t tick) {
  Restarted restarted;
  const double time_s = sil::fault_time_s(scenario_, tick), before_s = sil::fault_time_s(scenario_, tick - 1);
  for (const Fault& fault : scenario_.faults) {
    if (!fault.of(FaultLayer::kPeer) || !fault.begun(time_s)) continue;
    const char* program = program_of(*fault.peer);
    const bool first = !fault.begun(before_s);
    const auto sleep = [&](double seconds) {
      children_.signal(program, SIGSTOP);
      const auto until =
          std::isfinite(seconds) ? hal::after(Clock::now(), hal::Seconds(seconds)) : Clock::time_point::max();
      Clock::time_point& awake = asleep_until_.try_emplace(*fault.peer, until).first->second;
      awake = std::max(awake, until);
    };
    if (first) injected_ += (injected_.empty() ? "" : ", ") + to_string(fault);
    if (first && fault.kind == FaultKind::kPeerKilled) children_.signal(program, SIGKILL);
    if (first && fault.kind == FaultKind::kPeerFrozen) sleep(fault.end_s - fault.time_s);
    if (first && fault.kind == FaultKind::kPeerRestarted) {
      trouble_ = children_.restart(program);
      asleep_until_.erase(*fault.peer);  // it is another process now
      (*fault.peer == FaultPeer::kController ? restarted.controller : restarted.monitor) = true;
    }
    if (fault.kind == FaultKind::kPeerTooSlow && fault.active(time_s)) {
      sleep(fault.value * scenario_.run.control_period_s);
    }
  }
  return restarted;
}

std::string PeerFaults::look() {
  std::erase_if(asleep_until_, [this](const auto& sleeper) {
    const auto& [peer, until] = sleeper;
    if (Clock::now() < until) return false;
    children_.signal(program_of(peer), SIGCONT);
    return true;
  });
  if (!trouble_.empty()) return trouble_;
  const std::string ended = children_.ended();
  return ended.empty() || injected_.empty() ? ended : ended + " (injected: " + injected_ + ")";
}

hal::Status FaultyProcesses::send(sil::Lap& lap) {
  const PeerFaults::Restarted restarted = faults_.strike(lap.tick());
  const hal::Status status = peers_.wait_for_restarted(restarted.controller, restarted.monitor);
  return status == hal::Status::kOk ? peers_.send(lap) : status;
}

}  // namespace ballast
