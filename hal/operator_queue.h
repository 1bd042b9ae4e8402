// Commands that wait for their tick. The controller obeys one per tick.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace ballast::hal {

// First in, first out, but for the stop, the only command that makes less move: it takes back what waits, an older stop
// too, and goes first. So there is always room for it, and it is obeyed in the next tick. Any other command is refused
// when there is no room.
template <class Command, std::size_t kCapacity>
class OperatorQueue {
 public:
  // False: there was no room; never of a stop.
  [[nodiscard]] bool push(const Command& command, bool stop) {
    if (stop) {
      dropped_ += static_cast<std::int64_t>(count_);
      count_ = 0;
    } else if (count_ == kCapacity) {
      ++dropped_;
      return false;
    }
    commands_[(first_ + count_++) % kCapacity] = command;
    return true;
  }
  // What pop() takes; nullptr: nothing.
  [[nodiscard]] const Command* front() const { return count_ == 0 ? nullptr : &commands_[first_]; }
  void pop() {
    first_ = (first_ + 1) % kCapacity;
    --count_;
  }

  // Commands that were never at the front: taken back by a stop, or refused.
  [[nodiscard]] std::int64_t dropped() const { return dropped_; }

 private:
  std::array<Command, kCapacity> commands_{};
  std::size_t first_ = 0, count_ = 0;
  std::int64_t dropped_ = 0;
};

}  // namespace ballast::hal
