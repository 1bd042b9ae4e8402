// Parts that the boards share: the order of ticks, and values that are handed out once.
#pragma once

#include <cstdint>

#include "hal/host_link.h"
#include "hal/status.h"

namespace ballast::hal {

// Every board serves its ticks in order and once. The first one may have any number.
class TickOrder {
 public:
  // True: `tick` is the first one or the next. False: it is repeated or out of order, and counted.
  [[nodiscard]] bool is_next(std::int64_t tick, LinkCounters& counters) const {
    if (!begun_ || tick == newest_ + 1) return true;
    std::int64_t& counter = tick == newest_ ? counters.repeated : counters.out_of_order;
    ++counter;
    return false;
  }
  void begin(std::int64_t tick) {
    begun_ = true;
    newest_ = tick;
  }

  [[nodiscard]] bool begun() const { return begun_; }
  [[nodiscard]] std::int64_t newest() const { return newest_; }  // 0 before the first tick

 private:
  bool begun_ = false;
  std::int64_t newest_ = 0;
};

// Copies `from` to `to` once: if `there` is set, which is then cleared. kEmpty: it was not set, and `to` is untouched.
template <class T>
Status hand_out(bool& there, const T& from, T& to) {
  if (!there) return Status::kEmpty;
  to = from;
  there = false;
  return Status::kOk;
}

}  // namespace ballast::hal
