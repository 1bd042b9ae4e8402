// Bursts of a stretch without reversals, proved as a whole instead of pulse by pulse. This is the fast path of steps.
#pragma once

#include "firmware/motion/burst.h"
#include "firmware/motion/crossing.h"

namespace ballast::firmware {

// A stretch of a control tick in which velocity and acceleration keep their signs.
struct SmoothRun {
  StepCubic cubic;
  Wide begin_s = 0;  // of the stretch, in the cubic's time
  Wide end_s = 0;
  Wide start_s = 0;           // of the cubic, from the control tick's start
  Wide first_level = 0;       // crossed first; the others follow in steps of `direction`
  int direction = 1;          // +1 or -1
  int steps = 0;              // >= 1, all levels inside the stretch
  std::int32_t earliest = 0;  // timer tick of the first pulse at the earliest, by a pulse before this control tick
};

// Writes the run's bursts, without the motor, to `bursts` and returns their number. Each burst's length is halved until
// it fits. Returns 0 if the bounds below do not prove every pulse within the tolerance of its crossing and the
// distances kept, or if `bursts` has too few entries.
//
// Proof. The crossing time t(n) of level n has t''' = (3 a^2 - v j) / v^5, so a parabola q through the crossings 0, h,
// m of m + 1 pulses is off by at most (m^3 / 60) max|t'''| at the others (0.1 m^3 bounds |n (n - h) (n - m)| for h = m
// / 2 rounded down). A burst is a parabola with integer coefficients. Its distance from q is a parabola too, with its
// extremes at its ends or its vertex.
int smooth_bursts(const SmoothRun& run, const PulseRules& rules, Wide timer_frequency_hz, std::span<StepBurst> bursts);

}  // namespace ballast::firmware
