// One channel on its way to one who hears it, made to suffer by the scenario's faults of messages: it loses, delays,
// doubles, reorders and injures them. All of it follows from the scenario, its seed and what was said, tick by tick, so
// that it is the same wherever the hearer is: in the plant's process or in one of its own.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "hal/lcm/messages.h"
#include "sim/motors/random.h"
#include "sim/scenario/scenario.h"

namespace ballast::sil {

// What the faults of messages and peers go by; in the countdown none is there yet.
inline double fault_time_s(const sim::Scenario& scenario, std::int64_t tick) {
  return tick < 0 ? -1 : static_cast<double>(tick) * scenario.run.control_period_s;
}

// Counts what arrives and is no message. `to`: none is the plant.
template <class M>
class InjuredLink {
 public:
  InjuredLink(const sim::Scenario& scenario, const char* channel, std::optional<sim::FaultPeer> to);

  void send(const M& message, std::int64_t tick, double time_s);
  // What has arrived by this tick, in the order of arrival.
  [[nodiscard]] std::vector<M> arrive(std::int64_t tick);
  [[nodiscard]] std::int64_t malformed() const { return malformed_; }

 private:
  struct OnItsWay {
    std::int64_t due_tick;
    double order;
    std::vector<std::uint8_t> bytes;
  };
  [[nodiscard]] bool strikes(const sim::Fault& fault);

  std::vector<sim::Fault> faults_;
  std::uint64_t random_;
  std::vector<OnItsWay> on_its_way_;
  std::int64_t sent_ = 0;
  std::int64_t malformed_ = 0;
};

}  // namespace ballast::sil
