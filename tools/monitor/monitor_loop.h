// The monitor as a process of its own: hears the plant and the controller over LCM and publishes a verdict on every
// tick.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "hal/host_link.h"
#include "hal/lcm/bus.h"
#include "tools/monitor/monitor.h"

namespace ballast::monitor {

struct MonitorLoopOptions {
  double control_period_s = 0;
  hal::Seconds start_timeout{30};  // until the plant's first message
  hal::Seconds peer_timeout{2};    // from one tick to the next
  // Passes the samples on to the monitor, changed or delayed; none: Monitor::judge().
  std::function<void(const Samples&)> judge{};
};

// Before the first tick the loop publishes a trip_t with tick -3 every 50 ms. The plant's first message names the run;
// from then on messages of other runs are dropped (hal/lcm/bus.h). Tick k is judged, and the verdict published, as soon
// as contact(k), plant_state(k), sensors(k) and, with a controller, its status of k-1 are there. Messages still missing
// half a peer timeout after the tick's first one are judged as missing, so that the verdict is out before the
// controller gives the monitor up. After a whole timeout without any message the loop publishes a `stale` verdict and
// ends. The bus and the monitor must outlive the loop.
class MonitorLoop {
 public:
  // `limits`: those of `monitor`.
  MonitorLoop(hal::Bus& bus, Monitor& monitor, const MonitorLimits& limits, const MonitorLoopOptions& options);
  MonitorLoop(const MonitorLoop&) = delete;
  MonitorLoop& operator=(const MonitorLoop&) = delete;

  // kEnded: the plant announced its last tick, and it has been judged. Never kOk.
  hal::Status run();

  [[nodiscard]] const trip_t& verdict() const { return monitor_.verdict(); }
  [[nodiscard]] hal::LinkCounters counters() const;

  // One line per peer that failed.
  [[nodiscard]] const std::string& trouble() const { return trouble_; }

 private:
  // The plant's messages about one tick.
  struct TickMessages {
    std::optional<contact_t> contact;
    std::optional<plant_state_t> plant_state;
    std::optional<sensors_t> sensors;
    bool repeated = false;  // one of them came twice
    [[nodiscard]] bool empty() const { return !contact && !plant_state && !sensors; }
    [[nodiscard]] bool complete() const { return contact && plant_state && sensors; }
    [[nodiscard]] std::int64_t tick() const;
  };

  template <class M>
  void on_plant(const M& message, std::optional<M> TickMessages::*slot);
  bool is_foreign(std::int64_t scenario_id, const char* sender);
  [[nodiscard]] bool controller_heard() const;
  [[nodiscard]] bool ready() const;
  hal::Status wait();
  hal::Status judge();
  hal::Status plant_silent(hal::Seconds silence);
  void complain(const std::string& line);

  hal::Bus& bus_;
  Monitor& monitor_;
  MonitorLimits limits_;
  MonitorLoopOptions options_;
  TickMessages current_, next_;                // next_: came before current_ was complete
  std::optional<std::int64_t> last_tick_;      // judged
  bool last_complete_ = false;                 // with all of the plant's messages
  std::optional<controller_status_t> status_;  // the newest
  hal::LinkCounters counters_;
  hal::Status failure_ = hal::Status::kOk;
  bool controller_lost_ = false;
  std::string trouble_;
};

}  // namespace ballast::monitor
