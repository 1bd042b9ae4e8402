// The operator's messages on a bus, each handed out once.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <deque>
#include <optional>

#include "hal/lcm/messages.h"

namespace ballast::hal {

// The message does not name its sender, so two senders' sequences cannot be told apart: what is an exact copy of a
// recent message is a repetition, everything else is handed out in the order of arrival. No stop is ever taken for an
// old one.
class OperatorInbox {
 public:
  void hear(const operator_t& message) {
    if (is_known(message)) {
      ++repeated_;
      return;
    }
    know(message);
    // Commands are obeyed one per tick; in a flood of them the oldest go, so that a stop still comes through.
    if (waiting_.size() == kMostWaiting) waiting_.pop_front();
    waiting_.push_back(message);
  }

  // One's own: a bus gives back what is published on it.
  void know(const operator_t& message) { recent_[known_++ % recent_.size()] = message; }

  std::optional<operator_t> next() {
    if (waiting_.empty()) return std::nullopt;
    const operator_t message = waiting_.front();
    waiting_.pop_front();
    return message;
  }

  [[nodiscard]] std::int64_t repeated() const { return repeated_; }

 private:
  static constexpr std::size_t kMostWaiting = 64;

  [[nodiscard]] bool is_known(const operator_t& message) const {
    const auto same = [&message](const operator_t& other) {
      return other.tick == message.tick && other.utime == message.utime && other.sequence == message.sequence &&
             other.command == message.command && other.move_masses == message.move_masses &&
             std::memcmp(other.target_position, message.target_position, sizeof message.target_position) == 0 &&
             std::memcmp(&other.speed_fraction, &message.speed_fraction, sizeof message.speed_fraction) == 0;
    };
    const auto end = recent_.begin() + static_cast<std::ptrdiff_t>(std::min(known_, recent_.size()));
    return std::any_of(recent_.begin(), end, same);
  }

  std::deque<operator_t> waiting_;
  std::array<operator_t, 32> recent_{};
  std::size_t known_ = 0;  // ever entered
  std::int64_t repeated_ = 0;
};

}  // namespace ballast::hal
