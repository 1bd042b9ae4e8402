// Feeds ballast-foxglove, the server that shows a run to Foxglove, with the messages of a run on the bus.
//
// The server has the robot's shape from a scenario. So the feed passes on only messages of a run of that scenario. It
// passes on complete ticks, at most 60 per second of the wall clock and the run's last. Messages that the server is too
// slow for are dropped, so that the caller never waits for it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "hal/lcm/messages.h"
#include "sim/scenario/scenario.h"
#include "tools/ballast/event_pipe.h"
#include "tools/ballast/shown_run.h"

namespace ballast {

class FoxgloveFeed {
 public:
  explicit FoxgloveFeed(const sim::Scenario& scenario) : scenario_id_(scenario.id), scenario_(scenario) {}
  FoxgloveFeed(const FoxgloveFeed&) = delete;
  FoxgloveFeed& operator=(const FoxgloveFeed&) = delete;

  // Starts the server. Empty, or the reason why it could not be started. Ignores SIGPIPE from here on.
  [[nodiscard]] std::string start(const std::string& host, int port);

  // Takes valid messages with the wall clock's seconds.
  void observe(const contact_t& message, double now_s);
  void observe(const plant_state_t& message, double now_s);
  void observe(const sensors_t& message, double now_s);
  void observe(const controller_status_t& message, double now_s);
  void observe(const step_command_t&, double) {}
  void observe(const trip_t& message, double now_s);

  // The server has ended, which it does not do by itself. Empty: it runs.
  [[nodiscard]] std::string ended() { return pipe_.ended(); }
  // The run on the bus is one of another scenario.
  [[nodiscard]] bool foreign() const { return known_ && !ours_; }

 private:
  // Whether the message belongs to the run that is shown. That is the first one heard, until it ends or is silent.
  bool is_shown(std::int64_t run_id, double now_s);
  void recognise(std::int64_t scenario_id);
  void pass_on(double now_s);

  std::int64_t scenario_id_;
  const sim::Scenario& scenario_;
  EventPipe pipe_;

  ShownRun run_;
  bool known_ = false, ours_ = false;  // of that run
  double passed_s_ = 0;
  std::int64_t events_ = 0;
  std::optional<contact_t> contact_;
  std::optional<plant_state_t> state_;
  std::optional<controller_status_t> status_;
  std::optional<trip_t> trip_;
};

}  // namespace ballast
