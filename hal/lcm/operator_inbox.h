// The operators' messages on a bus, each handed out once.
#pragma once

#include <algorithm>
#include <array>
#include <deque>
#include <optional>

#include "hal/host_link.h"
#include "hal/lcm/messages.h"

namespace ballast::hal {

// A sender's messages count up, so what is not after its newest is a copy or comes late, and is not handed out. A stop
// that comes late is: to stop once more than was meant does no harm, not to stop does.
class OperatorInbox {
 public:
  void hear(const operator_t& message) {
    Sender& sender = sender_of(message.sender);
    if (sender.own && message.sequence <= sender.newest_own) return;  // a bus gives back what is published on it
    const bool stop = message.command == operator_t::COMMAND_STOP;
    if (sender.known && message.sequence <= sender.newest) {
      const bool copy = message.sequence == (stop ? sender.newest_stop : sender.newest);
      if (copy || !stop) {
        ++(copy ? counters_.repeated : counters_.old);
        return;
      }
    } else {
      sender.newest = message.sequence;
      sender.known = true;
    }
    if (stop) sender.newest_stop = message.sequence;
    // Commands are obeyed one per tick; in a flood of them the oldest go, so that a stop still comes through.
    if (waiting_.size() == kMostWaiting) waiting_.pop_front();
    waiting_.push_back(message);
  }

  // One's own, about to be published: it is not handed out when it comes back.
  void know(const operator_t& message) {
    Sender& sender = sender_of(message.sender);
    sender.newest = sender.known ? std::max(sender.newest, message.sequence) : message.sequence;
    sender.newest_own = message.sequence;
    sender.own = sender.known = true;
  }

  std::optional<operator_t> next() {
    if (waiting_.empty()) return std::nullopt;
    const operator_t message = waiting_.front();
    waiting_.pop_front();
    return message;
  }

  // What next() would hand out; nullptr: nothing.
  [[nodiscard]] const operator_t* peek() const { return waiting_.empty() ? nullptr : &waiting_.front(); }

  // Of these only `repeated` and `old` are counted here.
  [[nodiscard]] const LinkCounters& counters() const { return counters_; }

 private:
  static constexpr std::size_t kMostWaiting = 64;

  struct Sender {
    std::int64_t id = 0;
    bool own = false, known = false;
    std::int64_t newest = 0, newest_own = 0;
    std::optional<std::int64_t> newest_stop;
    std::int64_t used = 0;  // when, in messages heard; 0: the place is free
  };

  // Somebody who invents senders makes the oldest be forgotten, so that these could be heard again; but never oneself.
  Sender& sender_of(std::int64_t id) {
    ++heard_;
    auto place =
        std::find_if(senders_.begin(), senders_.end(), [id](const Sender& s) { return s.used > 0 && s.id == id; });
    if (place == senders_.end()) {
      const auto older = [](const Sender& a, const Sender& b) { return a.own != b.own ? b.own : a.used < b.used; };
      place = std::min_element(senders_.begin(), senders_.end(), older);
      *place = Sender();
      place->id = id;
    }
    place->used = heard_;
    return *place;
  }

  std::deque<operator_t> waiting_;
  std::array<Sender, 32> senders_{};
  std::int64_t heard_ = 0;
  LinkCounters counters_;
};

}  // namespace ballast::hal
