// Operators' messages from a bus, each handed out once.
#pragma once

#include <algorithm>
#include <array>
#include <optional>

#include "hal/host_link.h"
#include "hal/lcm/messages.h"
#include "hal/operator_queue.h"

namespace ballast::hal {

// The rules differ for stops, because an extra stop does no harm and a missing one does.
//
// Order. A sender numbers its messages upward. A message that is not newer than its sender's newest is a copy or late:
// it is counted and not handed out. A stop is handed out unless it, or a later stop of its sender, was before.
//
// Future ticks. A sender knows the run's newest tick, so a message of a tick still to come is counted as `old` and not
// handed out. A stop is handed out, and its tick is not remembered.
//
// Waiting. Messages wait in an OperatorQueue, where a stop goes first. A message that finds the queue full counts as
// not heard, so its sender can repeat it.
//
// Memory. kMostSenders senders are known. A new one replaces the sender that has been silent for longest, but never the
// process's own. From then on a sender that is not known needs a tick after the newest tick of all senders replaced;
// earlier messages are counted as `old`. So no message of a replaced sender is handed out twice, except a stop.
class OperatorInbox {
 public:
  static constexpr std::size_t kMostSenders = 32;
  static constexpr std::size_t kMostWaiting = 64;
  static constexpr std::int64_t kMostAhead = 2;  // ticks; the run gives its own commands before their tick

  // Sets the run's newest tick. Before the first call no message is of a tick still to come.
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
    ++heard_;
    sender->used = heard_;
    if (message.sequence <= sender->newest_own) return;  // the bus returned the process's own message
    const std::optional<std::int64_t>& newest = stop ? sender->newest_stop : sender->newest;
    if (message.sequence <= newest) {
      std::int64_t& counter = message.sequence == newest ? counters_.repeated : counters_.old;
      ++counter;
      return;
    }
    if (!waiting_.push(message, stop)) return;
    if (stop) sender->newest_stop = message.sequence;
    sender->newest = std::max(sender->newest, std::optional(message.sequence));
    if (!to_come) sender->newest_tick = std::max(sender->newest_tick, std::optional(message.tick));
  }

  // Announces the process's own message before it is published, so that it is not handed out when the bus returns it.
  void know(const operator_t& message) {
    Sender* sender = find(message.sender);
    if (sender == nullptr) sender = &take_place(message.sender);
    ++heard_;
    sender->used = heard_;
    sender->newest = std::max(sender->newest, std::optional(message.sequence));
    sender->newest_own = message.sequence;
  }

  std::optional<operator_t> next() {
    operator_t message;
    return waiting_.take(message) == Status::kOk ? std::optional(message) : std::nullopt;
  }

  // The message next() will hand out; nullptr: none waits.
  [[nodiscard]] const operator_t* peek() const { return waiting_.front(); }

  // Only `repeated`, `old` and `dropped` are counted here.
  [[nodiscard]] LinkCounters counters() const {
    LinkCounters counters = counters_;
    counters.dropped = waiting_.dropped();
    return counters;
  }

 private:
  // An optional without a value is less than any number.
  struct Sender {
    std::int64_t id = 0;
    std::optional<std::int64_t> newest, newest_stop, newest_own, newest_tick;
    std::optional<std::int64_t> after_tick;  // commands up to this tick may date from before the sender was replaced
    std::int64_t used = 0;                   // messages heard in all when this one spoke last; 0: the place is free
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
