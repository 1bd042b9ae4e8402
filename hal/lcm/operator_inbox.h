// The operators' messages on a bus, each handed out once.
#pragma once

#include <algorithm>
#include <array>
#include <optional>

#include "hal/host_link.h"
#include "hal/lcm/messages.h"
#include "hal/operator_queue.h"

namespace ballast::hal {

// A sender's messages count up, so what is not after its newest is a copy or comes late, and is not handed out. A stop
// is handed out however late it comes, unless that stop or a later one of its sender's was before: to stop once more
// than was meant does no harm, not to stop does. What is handed out waits in an OperatorQueue, where a stop goes first;
// a message for which there is no room has not been heard, so that its sender can say it again.
//
// A command is given in a tick that its sender has heard of, so one of a tick still to come is not believed: it is
// counted as `old` too, and not handed out. A stop is; its tick is forgotten.
//
// There is memory for kMostSenders. One more makes the one silent for longest be forgotten, but never oneself. From
// then on only messages given after the newest tick of those forgotten are taken from a sender who is not known, nor
// later, when a stop has made it known, so that none of theirs can come back; those before are counted as `old`. Stops
// are taken from anybody, any time; one of a sender forgotten may be so once more.
class OperatorInbox {
 public:
  static constexpr std::size_t kMostSenders = 32;
  static constexpr std::size_t kMostWaiting = 64;
  static constexpr std::int64_t kMostAhead = 2;  // ticks; the run's own commands come before the tick they are of

  // Which tick it is. Until this is said any is believed.
  void now(std::int64_t tick) { now_tick_ = tick; }

  void hear(const operator_t& message) {
    const bool stop = message.command == operator_t::COMMAND_STOP;
    const bool to_come = now_tick_ && message.tick > *now_tick_ + kMostAhead;
    if (to_come && !stop) {
      ++counters_.old;
      return;
    }
    Sender* sender = find(message.sender);
    const std::optional<std::int64_t> after_tick = sender == nullptr ? forgotten_tick_ : sender->after_tick;
    if (message.tick <= after_tick && !stop) {
      ++counters_.old;
      return;
    }
    if (sender == nullptr) {
      sender = &take_place(message.sender);
      sender->after_tick = after_tick;
    }
    sender->used = ++heard_;
    if (message.sequence <= sender->newest_own) return;  // a bus gives back what is published on it
    const std::optional<std::int64_t>& newest = stop ? sender->newest_stop : sender->newest;
    if (message.sequence <= newest) {
      ++(message.sequence == newest ? counters_.repeated : counters_.old);
      return;
    }
    if (!waiting_.push(message, stop)) return;
    if (stop) sender->newest_stop = message.sequence;
    sender->newest = std::max(sender->newest, std::optional(message.sequence));
    if (!to_come) sender->newest_tick = std::max(sender->newest_tick, std::optional(message.tick));
  }

  // One's own, about to be published: it is not handed out when it comes back.
  void know(const operator_t& message) {
    Sender* sender = find(message.sender);
    if (sender == nullptr) sender = &take_place(message.sender);
    sender->used = ++heard_;
    sender->newest = std::max(sender->newest, std::optional(message.sequence));
    sender->newest_own = message.sequence;
  }

  std::optional<operator_t> next() {
    if (waiting_.front() == nullptr) return std::nullopt;
    const operator_t message = *waiting_.front();
    waiting_.pop();
    return message;
  }

  // What next() would hand out; nullptr: nothing.
  [[nodiscard]] const operator_t* peek() const { return waiting_.front(); }

  // Of these only `repeated`, `old` and `dropped` are counted here.
  [[nodiscard]] LinkCounters counters() const {
    LinkCounters counters = counters_;
    counters.dropped = waiting_.dropped();
    return counters;
  }

 private:
  // Without a value: none; it is less than any.
  struct Sender {
    std::int64_t id = 0;
    std::optional<std::int64_t> newest, newest_stop, newest_own, newest_tick;
    std::optional<std::int64_t> after_tick;  // commands up to it may be of the time before it was forgotten
    std::int64_t used = 0;                   // when, in messages heard; 0: the place is free
  };

  Sender* find(std::int64_t id) {
    const auto place =
        std::find_if(senders_.begin(), senders_.end(), [id](const Sender& s) { return s.used > 0 && s.id == id; });
    return place == senders_.end() ? nullptr : &*place;
  }
  Sender& take_place(std::int64_t id) {
    const auto older = [](const Sender& a, const Sender& b) {
      return a.newest_own.has_value() != b.newest_own.has_value() ? b.newest_own.has_value() : a.used < b.used;
    };
    Sender& place = *std::min_element(senders_.begin(), senders_.end(), older);
    forgotten_tick_ = std::max(forgotten_tick_, place.newest_tick);
    place = Sender();
    place.id = id;
    return place;
  }

  OperatorQueue<operator_t, kMostWaiting> waiting_;
  std::array<Sender, kMostSenders> senders_{};
  std::optional<std::int64_t> forgotten_tick_;
  std::optional<std::int64_t> now_tick_;
  std::int64_t heard_ = 0;
  LinkCounters counters_;
};

}  // namespace ballast::hal
