// Follows trips and stops: the first tick in which the controller stops, its latency, and when the stop is complete.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "tools/sil/run_result.h"

namespace ballast::sil {

class TripWatch {
 public:
  explicit TripWatch(bool has_controller) : has_controller_(has_controller) {}

  // `trip`: the monitor's last verdict.
  void observe(const Lap& lap, const trip_t& trip);

  // In the last lap the controller was stopping or stopped, or will not start.
  [[nodiscard]] bool stopping() const { return stopping_; }
  // The last step of the latest stop has been executed at the start of this tick, and no operator has released it
  // since.
  [[nodiscard]] bool stop_done(std::int64_t tick) const { return done_tick_ && tick >= *done_tick_; }
  [[nodiscard]] const std::optional<ControllerTrip>& controller_trip() const { return controller_trip_; }
  [[nodiscard]] std::optional<std::int64_t> latency_ticks() const { return latency_ticks_; }

 private:
  void observe_stop(const Lap& lap, const trip_t& trip);

  bool has_controller_;
  bool armed_ = false;  // at least once
  bool stopping_ = false;
  std::deque<step_command_t> history_;
  std::optional<ControllerTrip> controller_trip_;
  std::optional<std::int64_t> latency_ticks_, done_tick_;
};

}  // namespace ballast::sil
