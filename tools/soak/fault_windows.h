// When an injected fault can affect what peers and run do. Each fault has a window of ticks: from the tick in which it
// begins to the last in which its effect can show. Outside all windows a run has to be as sound as one without faults.
#pragma once

#include <cstdint>

#include "sim/scenario/scenario.h"

namespace ballast::soak {

class FaultWindows {
 public:
  // The scenario must outlive the windows.
  explicit FaultWindows(const sim::Scenario& scenario);

  // Messages, peers or the sensors' clock: a message or an answer may be missing, late, repeated or wrong.
  [[nodiscard]] bool bus(std::int64_t tick) const;
  // Bits of messages are flipped: a message may say anything that decodes.
  [[nodiscard]] bool corruption(std::int64_t tick) const;
  // The attitude or the rate that the controller gets is not the true one.
  [[nodiscard]] bool sensors(std::int64_t tick) const;
  // A sensor says NaN.
  [[nodiscard]] bool nan(std::int64_t tick) const;
  // A force that the controller is not told of pushes the ball.
  [[nodiscard]] bool push(std::int64_t tick) const;
  // The end switches that the controller gets are not the true ones.
  [[nodiscard]] bool switches(std::int64_t tick) const;
  // The monitor has been started again in this tick, and has forgotten what it saw.
  [[nodiscard]] bool monitor_restarts(std::int64_t tick) const;
  // In this tick or a little earlier: its verdicts may still be those of before.
  [[nodiscard]] bool monitor_restarted(std::int64_t tick) const;

 private:
  template <class Selects>
  [[nodiscard]] bool any(std::int64_t tick, Selects selects) const;

  const sim::Scenario& scenario_;
  std::int64_t aftermath_ticks_;
};

}  // namespace ballast::soak
