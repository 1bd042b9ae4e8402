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

// So many ticks of a slip count, from its detection on, as their mean: less would be the noise of a sample, and more
// may be those of a ball that rolls again, because the detection lasts longer than the slip.
inline constexpr std::int64_t kSlipTicks = 16;

// Once per control tick in which masses move, with what was measured by it. Nothing but reset() raises `least`.
inline void learn(const MeasuredContact& measured, SlipFriction& friction) {
  const bool slips = measured.valid && measured.slip_detected;
  if (slips && !friction.slips) {
    friction.sum = 0;
    friction.ticks = 0;
  }
  friction.slips = slips;
  const bool finite = measured.mu_required > 0 && measured.mu_required < std::numeric_limits<Real>::infinity();
  if (!slips || !finite || friction.ticks == kSlipTicks) return;
  friction.sum += Wide{measured.mu_required};
  ++friction.ticks;
  if (friction.ticks < kSlipTicks) return;
  const auto mean = static_cast<Real>(friction.sum / static_cast<Wide>(friction.ticks));
  if (mean < friction.least) friction.least = mean;
}

}  // namespace ballast::firmware
