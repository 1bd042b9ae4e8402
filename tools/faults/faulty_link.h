// One channel from its sender to one receiver, with the scenario's message faults: messages are lost, delayed, doubled,
// reordered, corrupted or truncated. The result follows from the scenario, its seed and the messages, tick by tick, so
// it is the same in the plant's process and in the receiver's own.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "hal/lcm/messages.h"
#include "sim/motors/random.h"
#include "sim/scenario/scenario.h"

namespace ballast::sil {

// The time by which faults of messages and peers begin. Negative in the countdown, where no fault is active.
inline double fault_time_s(const sim::Scenario& scenario, std::int64_t tick) {
  return tick < 0 ? -1 : static_cast<double>(tick) * scenario.run.control_period_s;
}

template <class M>
class FaultyLink {
 public:
  // `to`: the receiver; none: the plant's motors.
  FaultyLink(const sim::Scenario& scenario, const char* channel, std::optional<sim::FaultPeer> to);

  void send(const M& message, std::int64_t tick, double time_s);
  // The messages that arrive by this tick and decode, in order of arrival.
  [[nodiscard]] std::vector<M> arrive(std::int64_t tick);
  // Messages that arrived and did not decode.
  [[nodiscard]] std::int64_t malformed() const { return malformed_; }

 private:
  struct InTransit {
    std::int64_t due_tick;
    double order;
    std::vector<char> bytes;
  };
  [[nodiscard]] bool strikes(const sim::Fault& fault);

  std::vector<sim::Fault> faults_;
  std::uint64_t random_;
  std::vector<InTransit> in_transit_;
  std::int64_t sent_ = 0;
  std::int64_t malformed_ = 0;
};

}  // namespace ballast::sil
