// What is known of a run that is being watched, and how it looks in a terminal.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "hal/lcm/messages.h"

namespace ballast::watch {

// Counts the messages of one channel, and by their tick numbers those that should have come between them. A tick that
// goes back by more than kLate is another run, or the same once more: counting starts again.
class TickCounter {
 public:
  static constexpr std::int64_t kLate = 64;

  void see(std::int64_t tick, double now_s);
  // Messages per second, of the last whole second or so; 0 once nothing comes any more.
  [[nodiscard]] double rate_hz(double now_s) const;
  [[nodiscard]] std::int64_t count() const { return count_; }
  [[nodiscard]] std::int64_t missed() const { return missed_; }

 private:
  std::optional<std::int64_t> newest_;
  std::int64_t count_ = 0, missed_ = 0;
  double window_start_s_ = 0, seen_s_ = 0;
  std::int64_t window_count_ = 0;
  double rate_hz_ = 0;
};

// Fed with valid messages and the wall clock's seconds; draws the state it has been told of. Of several runs on one bus
// it shows the first it hears, until that has ended or is silent; of the others, that they are there.
class View {
 public:
  void see(const contact_t& message, double now_s);
  void see(const plant_state_t& message, double now_s);
  void see(const sensors_t& message, double now_s);
  void see(const controller_status_t& message, double now_s);
  void see(const step_command_t& message, double now_s);
  void see(const trip_t& message, double now_s);

  // Nothing of a run has been heard yet.
  [[nodiscard]] bool empty() const { return !contact_ && !status_ && !trip_; }
  // The plant has said that the run ends with its last message.
  [[nodiscard]] bool ended() const { return ended_; }

  // Several lines, each ending in a newline, `width` columns at most, for a terminal that shows them in place.
  [[nodiscard]] std::string page(double now_s, int width, std::int64_t undecodable) const;
  // The same in one line without an end, for files and pipes.
  [[nodiscard]] std::string line(double now_s, std::int64_t undecodable) const;

 private:
  void start_again(std::int64_t tick);
  bool is_shown(std::int64_t run_id, double now_s);
  [[nodiscard]] bool is_over(double now_s) const;
  [[nodiscard]] bool hears_another_run(double now_s) const;
  // Seconds since the run that is shown, which has not ended, was last heard; none: too few to say so.
  [[nodiscard]] std::optional<double> silent_s(double now_s) const;

  std::optional<std::int64_t> run_id_;  // of the run that is shown
  double heard_s_ = 0;
  std::optional<double> heard_another_s_;
  std::optional<contact_t> contact_;
  std::optional<plant_state_t> state_;
  std::optional<controller_status_t> status_;
  std::optional<trip_t> trip_;
  double margin_min_ = 1, mu_required_max_ = 0, normal_force_min_n_ = 0, normal_force_max_n_ = 0;
  bool ended_ = false;
  enum Channel { kContact, kState, kSensors, kStatus, kSteps, kTrip, kChannels };
  std::array<TickCounter, kChannels> counters_;
};

}  // namespace ballast::watch
