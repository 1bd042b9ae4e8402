// The friction that a floor gave while the ball slipped: no more than that can be counted on.
#pragma once

#include <limits>

#include "firmware/estimation/estimate.h"

namespace ballast::firmware {

struct SlipFriction {
  Real least = std::numeric_limits<Real>::infinity();  // of all slips since reset(); infinite: it has not slipped
  bool slips = false;
  Wide sum = 0;  // of f_s / N over the ticks of the slip under way
  std::int64_t ticks = 0;
};

// So many ticks of a slip count, as their mean: less would be the noise of a sample.
inline constexpr std::int64_t kLeastSlipTicks = 16;

// Once per control tick, with what was measured by it. Nothing but reset() raises `least`.
inline void learn(const MeasuredContact& measured, SlipFriction& friction) {
  const bool slips = measured.valid && measured.slip_detected;
  if (slips && !friction.slips) {
    friction.sum = 0;
    friction.ticks = 0;
  }
  friction.slips = slips;
  if (!slips || !(measured.mu_required < std::numeric_limits<Real>::infinity())) return;
  friction.sum += Wide{measured.mu_required};
  ++friction.ticks;
  if (friction.ticks < kLeastSlipTicks) return;
  const auto mean = static_cast<Real>(friction.sum / static_cast<Wide>(friction.ticks));
  if (mean < friction.least) friction.least = mean;
}

}  // namespace ballast::firmware
