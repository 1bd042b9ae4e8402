#include "firmware/estimation/measured_masses.h"

#include <cmath>

namespace ballast::firmware {

namespace {

// Acceleration noise of a perfect accelerometer, as a part of gravity: its weight in the choice of omega.
constexpr auto kLeastNoise = static_cast<Real>(1e-3);

// omega T is at most this: beyond it the tracker follows single readings.
constexpr auto kGreatestStep = static_cast<Real>(0.5);
constexpr Wide kGreatest = 0x1p50;  // of a reading, as everywhere in the firmware
constexpr int kHalvings = 16;       // of omega, to 1e-5 of the greatest

// |zeta'|: the radius of a circle; lines and splines have arc length.
Real arm(const Rail& rail) { return rail.shape == RailShape::kCircle ? rail.radius_m : Real(1); }

// The root of q T^1/2 omega^5/2 / 8 = noise, by halving.
Real bandwidth(Real resolution, Real period_s, Real noise) {
  const Real target = 64 * noise * noise, density = resolution * resolution * period_s;
  Real low = 0, high = kGreatestStep / period_s;
  for (int k = 0; k < kHalvings; ++k) {
    const Real omega = (low + high) / 2, square = omega * omega;
    (density * square * square * omega > target ? high : low) = omega;
  }
  return high;
}

}  // namespace

void reset(const BallParams& ball, const EstimationParams& params, MassMeter& meter) {
  meter = {};
  Real total = ball.shell_mass_kg;
  for (int i = 0; i < ball.mass_count; ++i) total += ball.mass_kg[static_cast<std::size_t>(i)];
  const Real least = kLeastNoise * ball.gravity_mps2;
  const Real noise = params.accelerometer.noise > least ? params.accelerometer.noise : least;
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    meter.noise[k] = total * noise / (ball.mass_kg[k] * arm(ball.rail[k]));
  }
}

void measure_masses(const BallParams& ball, const EstimationParams& params, Wide control_period_s,
                    const Sensors& sensors, const MassMotion& commanded, MassMeter& meter, MassMotion& measured) {
  measured = commanded;
  if (!params.has_encoders || !sensors.has_encoders) return;
  const auto dt = static_cast<Real>(control_period_s);
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    MassDeviation& d = meter.deviation[k];
    if (std::fabs(sensors.encoder[k]) <= kGreatest) {
      d.position += dt * (d.velocity + dt / 2 * d.acceleration);
      d.velocity += dt * d.acceleration;
      // The difference of two coordinates that may be large is small: it is taken in full precision.
      const auto error = static_cast<Real>(sensors.encoder[k] - static_cast<Wide>(commanded.position[k])) - d.position;
      if (!(meter.bandwidth_radps[k] > 0)) {
        meter.bandwidth_radps[k] = bandwidth(params.encoder_resolution[k], dt, meter.noise[k]);
      }
      const Real theta = 1 / (1 + meter.bandwidth_radps[k] * dt), lost = 1 - theta;
      d.position += (1 - theta * theta * theta) * error;
      d.velocity += Real(1.5) * lost * lost * (1 + theta) / dt * error;
      d.acceleration += lost * lost * lost / (dt * dt) * error;
    } else {
      d.velocity = d.acceleration = 0;
    }
    measured.position[k] += d.position;
    measured.velocity[k] += d.velocity;
    measured.acceleration[k] += d.acceleration;
  }
}

}  // namespace ballast::firmware
