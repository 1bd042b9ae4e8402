// How far the commands of a certified plan are from its wishes, over time: what the tick adds to the wish, so that the
// robot repeats the plan that was certified.
//
// Invariants: fixed size, no heap.
#pragma once

#include <array>
#include <cstdint>

#include "firmware/model/ball.h"

namespace ballast::firmware {

class Bends {
 public:
  static constexpr int kMost = 256;

  // Nothing is bent. Times count from the start of `tick`. Points are left out where the line between others is within
  // `tolerance` of them (> 0, rail units / s^2).
  void clear(std::int64_t tick, const PerMass<Real>& tolerance);
  [[nodiscard]] std::int64_t start_tick() const { return start_tick_; }
  void shift(std::int64_t ticks) { start_tick_ += ticks; }

  // The next point, time_s >= that of the one before. Between points bends are lines, outside of them 0. Two points at
  // one time are a jump. False: there is no room for it.
  [[nodiscard]] bool add(Wide time_s, const PerMass<Real>& bend);

  // The bend at a time, 0 where it is within the tolerance of 0. Two points at one time give the earlier one. Times
  // within a quarter of `period_s` are one. A bisection, so it takes about log2(kMost) steps.
  [[nodiscard]] PerMass<Real> at(Wide time_s, Wide period_s) const;

 private:
  // Lines from the last point but one that pass all points left out since.
  struct Slopes {
    Real least = 0, most = 0;
  };
  // False: the line to the new point passes one of them.
  [[nodiscard]] bool passes(Wide time_s, const PerMass<Real>& bend) const;

  std::array<Wide, kMost> time_s_{};
  std::array<PerMass<float>, kMost> bend_{};
  PerMass<Slopes> slopes_{};
  PerMass<Real> tolerance_{};
  bool free_ = false;  // the last point may be left out
  int count_ = 0;
  std::int64_t start_tick_ = 0;
};

}  // namespace ballast::firmware
