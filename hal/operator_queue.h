// Operators' commands that wait for their tick. The controller obeys one per tick.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/status.h"

namespace ballast::hal {

// First in, first out, except for a stop: it cancels every command that waits, an older stop too, and goes first. So a
// stop always finds a place and is obeyed in the next tick. Any other command is refused when the queue is full.
template <class Command, std::size_t kCapacity>
class OperatorQueue {
 public:
  // False: the queue is full; never for a stop.
  [[nodiscard]] bool push(const Command& command, bool stop) {
    if (stop) {
      dropped_ += static_cast<std::int64_t>(count_);
      count_ = 0;
    } else if (count_ == kCapacity) {
      ++dropped_;
      return false;
    }
    commands_[(first_ + count_) % kCapacity] = command;
    ++count_;
    return true;
  }
  // The next command; nullptr: none waits.
  [[nodiscard]] const Command* front() const { return count_ == 0 ? nullptr : &commands_[first_]; }
  // Takes the next command out.
  Status take(Command& command) {
    if (count_ == 0) return Status::kEmpty;
    command = commands_[first_];
    first_ = (first_ + 1) % kCapacity;
    --count_;
    return Status::kOk;
  }

  // Commands that were cancelled by a stop or refused.
  [[nodiscard]] std::int64_t dropped() const { return dropped_; }

 private:
  std::array<Command, kCapacity> commands_{};
  std::size_t first_ = 0, count_ = 0;
  std::int64_t dropped_ = 0;
};

}  // namespace ballast::hal
