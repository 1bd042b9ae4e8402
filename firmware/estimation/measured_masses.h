// The masses' motion as the robot knows it: commanded, corrected by encoders where there are any.
//
// An encoder sees by how much a mass is off its command: swing and lag of its motor, and lost steps. A tracker of that
// deviation, of its rate and acceleration, with three equal poles at -omega, gives the correction. With readings that
// are multiples of q at a period T the acceleration's noise is q T^1/2 omega^5/2 / 8 (a white error of variance q^2 /
// 12 through omega^3 s^2 / (s + omega)^3). omega is the one at which this noise moves the force on the ball as much as
// the accelerometer's own noise does: m_i |zeta_i'| times it is M times that.
//
// Source: our derivation; the discrete tracker is the fading-memory filter of second degree (Morrison, Introduction to
// Sequential Smoothing and Prediction, 1969, section 13).
#pragma once

#include "firmware/estimation/estimate.h"
#include "firmware/estimation/sensors.h"
#include "firmware/model/ball.h"

namespace ballast::firmware {

// Deviation of one mass from its command, rail units, per s, per s^2.
struct MassDeviation {
  Real position = 0;
  Real velocity = 0;
  Real acceleration = 0;
};

struct MassMeter {
  PerMass<MassDeviation> deviation{};
  PerMass<Real> noise{};            // of the acceleration, per s^2, at which omega is chosen
  PerMass<Real> bandwidth_radps{};  // omega; 0 before the first reading
};

void reset(const BallParams& ball, const EstimationParams& params, MassMeter& meter);

// The masses' motion at the start of this tick. Once per control tick, in order. Without encoders `measured` equals
// `commanded`. A reading that is no possible number leaves the deviation where it was.
void measure_masses(const BallParams& ball, const EstimationParams& params, Wide control_period_s,
                    const Sensors& sensors, const MassMotion& commanded, MassMeter& meter, MassMotion& measured);

}  // namespace ballast::firmware
