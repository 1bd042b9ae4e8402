// The last values of something that is known tick by tick, for a reader that learns late: 64 of them, evenly spaced
// over the time that is asked for, with straight lines between.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "firmware/model/types.h"

namespace ballast::firmware::estimation {

// N components.
template <std::size_t N>
class History {
 public:
  using Value = std::array<Wide, N>;

  // Forgets everything. Values of the last `span_ticks` will be kept.
  void reset(std::int64_t span_ticks) {
    every_ticks_ = std::max<std::int64_t>(1, (span_ticks + kKept - 3) / (kKept - 2));
    size_ = 0;
  }

  // Ticks ascend.
  void add(std::int64_t tick, const Value& value) {
    newest_ = {tick, value};
    if (size_ > 0 && tick - entry(size_ - 1).tick < every_ticks_) return;
    if (size_ == kKept) {
      first_ = (first_ + 1) % kKept;
      --size_;
    }
    entry(size_++) = newest_;
  }

  // Before the oldest value that is kept: that one. After the newest: that one.
  [[nodiscard]] Value at(std::int64_t tick) const {
    if (size_ == 0) return Value{};
    if (tick >= newest_.tick) return newest_.value;
    // The youngest entry at or before the tick, by bisection.
    int below = 0, above = size_;
    while (above - below > 1) {
      const int middle = (below + above) / 2;
      (entry(middle).tick <= tick ? below : above) = middle;
    }
    const Entry &a = entry(below), &b = above < size_ ? entry(above) : newest_;
    if (tick <= a.tick || b.tick <= a.tick) return a.value;
    const Wide part = static_cast<Wide>(tick - a.tick) / static_cast<Wide>(b.tick - a.tick);
    Value value;
    for (std::size_t j = 0; j < N; ++j) value[j] = a.value[j] + part * (b.value[j] - a.value[j]);
    return value;
  }

 private:
  static constexpr int kKept = 64;
  struct Entry {
    std::int64_t tick = 0;
    Value value{};
  };
  [[nodiscard]] const Entry& entry(int i) const { return entries_[static_cast<std::size_t>((first_ + i) % kKept)]; }
  [[nodiscard]] Entry& entry(int i) { return entries_[static_cast<std::size_t>((first_ + i) % kKept)]; }

  std::array<Entry, kKept> entries_{};
  Entry newest_;
  int first_ = 0, size_ = 0;
  std::int64_t every_ticks_ = 1;
};

}  // namespace ballast::firmware::estimation
