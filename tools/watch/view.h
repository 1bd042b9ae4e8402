// The state of a run that `ballast watch` shows, as text for a terminal.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "hal/lcm/messages.h"

namespace ballast::watch {

// Counts the messages of one channel and, by their tick numbers, the missing ones. A tick that goes back by more than
// kLate belongs to another run, or to a repetition, and counting starts again.
class TickCounter {
 public:
  static constexpr std::int64_t kLate = 64;

  void add(std::int64_t tick, double now_s);
  // Messages per second over about the last second; 0 if no message comes any more.
  [[nodiscard]] double rate_hz(double now_s) const;
  [[nodiscard]] std::int64_t count() const { return count_; }
  [[nodiscard]] std::int64_t missed() const { return missed_; }

 private:
  std::optional<std::int64_t> newest_;
  std::int64_t count_ = 0, missed_ = 0;
  double window_start_s_ = 0, latest_s_ = 0;
  std::int64_t window_count_ = 0;
  double rate_hz_ = 0;
};

// Takes valid messages with the wall clock's seconds. Of several runs on one bus it shows the first until that ends or
// is silent, and tells that there are others.
class View {
 public:
  void observe(const contact_t& message, double now_s);
  void observe(const plant_state_t& message, double now_s);
  void observe(const sensors_t& message, double now_s);
  void observe(const controller_status_t& message, double now_s);
  void observe(const step_command_t& message, double now_s);
  void observe(const trip_t& message, double now_s);

  // No message of a run has come yet.
  [[nodiscard]] bool empty() const { return !contact_ && !status_ && !trip_; }
  // The plant's latest message is marked as the run's last.
  [[nodiscard]] bool ended() const { return ended_; }

  // Lines of at most `width` columns, each ending in a newline, for a terminal.
  [[nodiscard]] std::string page(double now_s, int width, std::int64_t undecodable) const;
  // One line without a newline, for files and pipes.
  [[nodiscard]] std::string line(double now_s, std::int64_t undecodable) const;

 private:
  void restart_if_new_run(std::int64_t tick);
  bool is_shown(std::int64_t run_id, double now_s);
  [[nodiscard]] bool is_over(double now_s) const;
  [[nodiscard]] bool has_another_run(double now_s) const;
  [[nodiscard]] std::string contact_lines(int width) const;
  [[nodiscard]] std::string controller_lines(int width) const;
  // Measurements and estimates of the robot, with 2 sigma; empty where it does neither.
  [[nodiscard]] std::string known_lines(int width) const;
  [[nodiscard]] std::string rate_lines(double now_s, int width, std::int64_t undecodable) const;
  // How long the shown run has been silent; nullopt: it has ended, or not long enough to report.
  [[nodiscard]] std::optional<double> silent_s(double now_s) const;

  std::optional<std::int64_t> run_id_;  // of the shown run
  double latest_s_ = 0;                 // time of the shown run's latest message
  std::optional<double> another_run_s_;
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
