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
// The greatest resonance() of an excitation whose frequency falls from r to 0.
inline Real falling_resonance(Real r, Real damping_ratio) {
  const Real peak = 1 - 2 * damping_ratio * damping_ratio;  // 1 / r^2 there
  return peak > 0 && r * r * peak > 1 ? resonance(1 / std::sqrt(peak), damping_ratio) : resonance(r, damping_ratio);
}

// Bound of |true - commanded| acceleration of a mass that moves at a steady speed, in rail units / s^2. Its field is
// off by half a microstep at the microsteps' frequency, and by step_error of a full step at the full steps'; the detent
// torque is a sine at the full steps'. What is left after a jump of the commanded acceleration is not in it. 0 at rest:
// the field does not move. Rounding can leave a stopped mass a speed; a millionth of a microstep a second is rest.
// `falls`: the greatest while the speed falls from there to 0.
inline Real acceleration_error(const MotorSwing& swing, Real velocity, bool falls = false) {
  const Real speed = std::fabs(velocity);
  if (!(swing.natural_radps > 0) || !(speed > Real(1e-6) * swing.microstep)) return 0;
  constexpr Real kTwoPi = Real(6.283185307179586);
  const Real per_unit = kTwoPi * speed / swing.natural_radps;
  const Real square = swing.natural_radps * swing.natural_radps;
  const auto gain = [&](Real r) {
    return falls ? falling_resonance(r, swing.damping_ratio) : resonance(r, swing.damping_ratio);
  };
  // Jumps of the field also have higher frequencies, far above resonance.
  const Real microsteps = std::fmax(gain(per_unit / swing.microstep), Real(1));
  const Real full_steps = gain(per_unit / swing.full_step);
  return square * (swing.microstep / 2 * microsteps +
                   2 * swing.step_error * swing.full_step * std::fmax(full_steps, Real(1))) +
         swing.detent * full_steps;
}

}  // namespace ballast::firmware
