// The bursts of a stretch without reversals, proved as a whole instead of pulse by pulse: what makes steps cheap.
#pragma once

#include "firmware/motion/burst.h"
#include "firmware/motion/crossing.h"

namespace ballast::firmware {

// A stretch of a control tick in which the velocity keeps its sign and its derivative does too.
struct SmoothRun {
  StepCubic cubic;
  Wide begin_s = 0;  // of the stretch, in the cubic's time
  Wide end_s = 0;
  Wide start_s = 0;           // of the cubic, from the control tick's start
  Wide first_level = 0;       // crossed first; the others follow in steps of `direction`
  int direction = 1;          // +1 or -1
  int steps = 0;              // >= 1, all levels inside the stretch
  std::int32_t earliest = 0;  // timer tick: because of a pulse before this control tick
};

// Writes the run's bursts (without the motor) to bursts[0..room) and returns their number. Each burst's length is
// halved until it fits. Returns 0 if these few sums do not prove every pulse within the tolerance of its crossing and
// the distances kept, or if `room` bursts do not suffice.
//
// Why it holds. The crossing time t(n) of level n has t''' = (3 a^2 - v j) / v^5, so a parabola q through the crossings
// 0, h, m of m + 1 pulses is off by at most (m^3 / 60) max|t'''| at the others (0.1 m^3 bounds |n (n - h) (n - m)| for
// h = m / 2 rounded down). A burst is a parabola with integer coefficients. Its distance from q is a parabola too, and
// greatest at its ends or its vertex.
int smooth_bursts(const SmoothRun& run, const PulseRules& rules, Wide timer_frequency_hz, StepBurst* bursts, int room);

}  // namespace ballast::firmware
