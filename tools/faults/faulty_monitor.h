// Monitors with the scenario's faults around them.
#pragma once

#include <deque>

#include "tools/faults/faulty_links.h"
#include "tools/faults/peer_state.h"
#include "tools/sil/local_peers.h"

namespace ballast::sil {

// Faults on the links to the monitor of a process of its own.
class FaultyLinksToMonitor {
 public:
  // Scenario and monitor must outlive the links.
  FaultyLinksToMonitor(monitor::Monitor& monitor, const sim::Scenario& scenario)
      : monitor_(monitor), links_(scenario) {}

  // In place of Monitor::judge(): the monitor judges what the links deliver.
  void judge(const monitor::Samples& samples);
  [[nodiscard]] hal::LinkCounters counters() const { return links_.counters(); }

 private:
  monitor::Monitor& monitor_;
  MonitorLinks links_;
  std::optional<std::int64_t> last_tick_;  // whose messages the links have carried
};

// A monitor in the plant's process, with faults on the links to it; it may be killed, frozen, restarted or slow.
class FaultyMonitor final : public LapMonitor {
 public:
  // The scenario must outlive the monitor.
  FaultyMonitor(const sim::Scenario& scenario, const monitor::MonitorLimits& limits);

  // Leaves the verdict empty in a tick in which the monitor does not speak. A slow monitor's verdict is of an earlier
  // tick.
  void judge(Lap& lap) override;
  // A status of the controller; a lap may have several.
  void hear_status(const controller_status_t& status, std::int64_t tick) { links_.send(status, tick); }
  void hear(const Lap&) override {}
  [[nodiscard]] hal::LinkCounters refused() const override { return links_.counters(); }

 private:
  struct Verdict {
    std::int64_t due_tick;
    trip_t trip;
  };

  const sim::Scenario& scenario_;
  monitor::MonitorLimits limits_;
  monitor::Monitor monitor_;
  MonitorLinks links_;
  PeerFaultClock faults_;
  std::deque<Heard> inbox_;
  std::deque<Verdict> verdicts_;
};

}  // namespace ballast::sil
