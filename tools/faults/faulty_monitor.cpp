#include "tools/faults/faulty_monitor.h"

namespace ballast::sil {

void FaultyLinksToMonitor::judge(const monitor::Samples& samples) {
  const bool complete = samples.contact != nullptr && samples.plant_state != nullptr && samples.sensors != nullptr;
  // The messages of a tick that is judged again (a repeated message) have been through the links already.
  if (!complete || samples.contact->tick == last_tick_) {
    monitor_.judge(samples);
    return;
  }
  // Only the status of the tick before is new to the link.
  if (samples.status != nullptr && last_tick_ && samples.status->tick == *last_tick_) {
    links_.send(*samples.status, *last_tick_);
  }
  last_tick_ = samples.contact->tick;
  sil::judge(monitor_, links_.deliver(*samples.contact, *samples.plant_state, *samples.sensors));
}

FaultyMonitor::FaultyMonitor(const sim::Scenario& scenario, const monitor::MonitorLimits& limits)
    : scenario_(scenario),
      limits_(limits),
      monitor_(limits),
      links_(scenario),
      faults_(scenario, sim::FaultPeer::kMonitor) {}

void FaultyMonitor::judge(Lap& lap) {
  const std::int64_t tick = lap.tick();
  inbox_.push_back(links_.deliver(lap.plant.contact, lap.plant.state, lap.plant.sensors));
  const PeerState now = faults_.advance(fault_time_s(scenario_, tick));
  if (now.restarted) {
    monitor_ = monitor::Monitor(limits_);
    inbox_.erase(inbox_.begin(), inbox_.end() - 1);
    verdicts_.clear();
  }
  if (now.works()) {
    for (const Heard& heard : inbox_) verdicts_.push_back({tick + now.slow_ticks, sil::judge(monitor_, heard)});
    inbox_.clear();
  }
  for (; !now.killed && !verdicts_.empty() && verdicts_.front().due_tick <= tick; verdicts_.pop_front()) {
    lap.verdict = verdicts_.front().trip;
  }
}

}  // namespace ballast::sil
