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

inline constexpr int kNotProved = 0, kNoRoom = -1;

// Where the bursts to come would have to be so many times as long as the one before, a search gives up.
inline constexpr int kHopeless = 4;

// Writes the run's bursts (without the motor) to bursts[0..room) and gives their number; kNotProved: these few sums do
// not prove every pulse within the tolerance of its crossing and the rules kept; kNoRoom: it would take more bursts, or
// surely seems to. Each burst's length is halved until it fits.
//
// Why it holds. The crossing time t(n) of level n has t''' = (3 a^2 - v j) / v^5, so a parabola q through the crossings
// 0, h, m of m + 1 pulses is off by at most (m^3 / 60) max|t'''| at the others (0.1 m^3 bounds |n (n - h) (n - m)| for
// h = m / 2 rounded down). A burst is a parabola with integer coefficients, and its distance from q is one too:
// greatest at its ends or its vertex.
int smooth_bursts(const SmoothRun& run, const PulseRules& rules, Wide timer_frequency_hz, StepBurst* bursts, int room);

// The same, but each burst the longest that fits: that takes longer, and fewer bursts. kNoRoom only if there is none.
int sparing_smooth_bursts(const SmoothRun& run, const PulseRules& rules, Wide timer_frequency_hz, StepBurst* bursts,
                          int room);

// All the run's pulses in no more than `room` bursts, of equal numbers of pulses as far as they go: straight lines from
// crossing to crossing. Distances are kept, and the control tick; the tolerance is not. (A straight line's interval is
// rounded to whole timer ticks, and m intervals stray by m / 4 and the run's bend in their time; a parabola's second
// difference is rounded too, and strays by m^2 / 16 more.) kNotProved: the pulses do not fit into the tick behind
// `earliest` so.
int coarse_smooth_bursts(const SmoothRun& run, const PulseRules& rules, Wide timer_frequency_hz, StepBurst* bursts,
                         int room);

}  // namespace ballast::firmware
