// How far the acceleration of a mass is from its command when a stepper moves it.
//
// Source: our derivation, tools/docs/governor.md, "Motors".
#pragma once

#include <cmath>

#include "firmware/governor/governor_params.h"

namespace ballast::firmware {

// Acceleration of a swinging mass for an excitation at r times the natural frequency, over that of a free mass: r^2 /
// sqrt((1 - r^2)^2 + (2 zeta r)^2). The excitation's own is natural^2 times the amplitude of its field.
inline Real resonance(Real r, Real damping_ratio) {
  const Real square = r * r, off = 1 - square, damped = 2 * damping_ratio * r;
  const Real below = off * off + damped * damped;
  return below > 0 ? square / std::sqrt(below) : 1;
}
// The same of an excitation that also has higher frequencies: at least 1, which it is far above resonance.
inline Real swing_gain(Real r, Real damping_ratio) { return std::fmax(resonance(r, damping_ratio), Real(1)); }

// Bound of |true - commanded| acceleration of a mass that moves at a steady speed, in rail units / s^2. Its field is
// off by half a microstep at the microsteps' frequency, and by step_error of a full step at the full steps'; the detent
// torque is a sine at the full steps'. What is left after a jump of the commanded acceleration is not in it. 0 at rest:
// the field does not move.
inline Real acceleration_error(const MotorSwing& swing, Real velocity) {
  const Real speed = std::fabs(velocity);
  if (!(swing.natural_radps > 0) || speed == 0) return 0;
  constexpr Real kTwoPi = Real(6.283185307179586);
  const Real per_unit = kTwoPi * speed / swing.natural_radps;
  const Real square = swing.natural_radps * swing.natural_radps;
  return square *
             (swing.microstep / 2 * swing_gain(per_unit / swing.microstep, swing.damping_ratio) +
              2 * swing.step_error * swing.full_step * swing_gain(per_unit / swing.full_step, swing.damping_ratio)) +
         swing.detent * resonance(per_unit / swing.full_step, swing.damping_ratio);
}

}  // namespace ballast::firmware
