// The contact force, and slip, as the robot itself measures them. Derivation and measured figures:
// tools/docs/measured_contact.md.
//
// Force. The accelerometer, less the terms of its offset, gives f = a_GC - g. With it Newton's law is
//   R = M f + sum m_i (Omegadot x zeta_i + c_i) - F_e,
// and Euler's, R put in, is A Omegadot = -Omega x I Omega - sum m_i s_i x (f + c_i) + r Gamma x F_e. Neither assumes
// rolling. Omegadot is what rolling would make of f, plus a correction nu by which an observer of 15 Hz makes the
// integral follow the gyro. What is left of Euler's equation is sum b_i e_i, b_i = m_i s_i x zeta_i', with e_i the
// acceleration by which mass i deviates from its known motion. Its part above 1.5 Hz, weighed against the noise of the
// sensors, gives the e_i, and they complete R.
//
// Slip. Over windows of 50 to 600 ms two speeds of the contact point are compared with what the second before leads one
// to expect:
//   - the accelerometer's integral less the change of omega x r e3;
//   - the moment by which the gyro's rate departs from that of a rolling ball with the known masses, in terms of slip.
// slip_detected: one of them exceeds its threshold, and the other confirms at least half of it. Alone, the first is
// misled by vibration at multiples of the sample rate, which looks constant, and the second by lost steps and by wrong
// masses, a wrong centre of mass and a floor that resists. The latter are learned as the ball rolls: what they are
// expected to do is taken off, and 3.5 sigma of the rest count (belief_errors.h). A steady slip is not seen. A
// threshold is the greater of 0.02 m/s (by rotation 0.025) and 4 sigma of what tilt and accelerometer do to the
// integral, with 6 sigma of noise and vibration. With fewer than three samples in 10 ms nothing is flagged.
//
// An accelerometer whose constant errors are 1 % of g or more cannot tell slip from tilt: slip_detected stays false.
//
// light_detected: for 10 ms N lies 3 sigma below a fifth of its value at rest.
//
// False alarms: tools/docs/measured_contact.md counts them, with true belief and with masses that are 5 and 10 % off.
// None in 300 runs with 5 % means that with 95 % confidence at most 1 % of such runs have one. Both
// flags stay false until the masses are first commanded to move after reset(), and follow their evidence from then on.
//
// Samples that are no numbers, at the end of their range, or repeated bit by bit in spite of noise are left out. The
// result is that of the newest sample until the next comes. It is no longer valid where that sample is older than the
// IMU's latency and 16 of its periods. No heap, no loop whose length depends on data. Called from one thread.
#pragma once

#include <array>

#include "firmware/estimation/belief_errors.h"
#include "firmware/estimation/estimate.h"
#include "firmware/estimation/sensors.h"
#include "firmware/model/ball.h"

namespace ballast::firmware {

namespace contact {

// Blocks of 10 ms, or of one sample if that is longer: a baseline of 1 s and a window of 0.6 s.
inline constexpr int kBlocks = 160;

// The velocity that the contact point has gained in the floor, measured in two ways; space frame.
struct Slip {
  Vector2 by_accelerometer_W_mps = Vector2::Zero();
  Vector2 by_rotation_W_mps = Vector2::Zero();
  std::int64_t gaps = 0;  // samples in it that follow none: the rate's noise on both sides of them stays in the sums
};

// Sums of gains since reset(), two components of each measure. Only their differences matter.
struct SlipTotal {
  std::array<Wide, 2> by_accelerometer_W_mps{};
  std::array<Wide, 2> by_rotation_W_mps{};
  std::int64_t gaps = 0;
};

// Values of the newest sample, for differences and for trapezoids.
struct LastSample {
  Vector3 rate_B_radps = Vector3::Zero();
  Vector3 rolling_B_radps2 = Vector3::Zero();        // Omegadot if the ball rolls
  Vector3 rolling_moment_B_nm = Vector3::Zero();     // A_s Omegadot of a rolling ball with the known masses
  Vector2 acceleration_W_mps2 = Vector2::Zero();     // of the geometric centre
  Vector2 gain_W_mps2 = Vector2::Zero();             // of that, since the sample before
  Vector2 rolling_velocity_W_mps = Vector2::Zero();  // omega x r e3
};

// Watches one triad for readings that repeat.
struct Repeats {
  Vector3 reading = Vector3::Zero();
  int count = 0;
};

}  // namespace contact

// Plain data; reset() makes it valid.
struct ContactMeter {
  bool moved = false;     // the masses have been commanded to move
  bool followed = false;  // `last` is that of the sample before
  std::int64_t imu_count = 0;
  std::int64_t imu_tick = 0;
  contact::Repeats gyro, accelerometer;
  contact::LastSample last;
  // Observer of the rate, and the part of a residual that changes slowly.
  Vector3 rate_B_radps = Vector3::Zero();
  Vector3 correction_B_radps2 = Vector3::Zero();  // nu
  Vector3 slow_moment_B_nm = Vector3::Zero();
  Real moment_power_n2m2 = 0;               // mean square of the fast part
  Vector3 impulse_B_nms = Vector3::Zero();  // its integral, less what is older than the swing
  Real impulse_power_n2m2s2 = 0;            // greatest square of that about the floor's axes, fading in 0.6 s
  // Slip.
  contact::Slip block;
  int block_samples = 0, next_block = 0, block_count = 0;
  contact::SlipTotal total;                                   // at the end of the newest block
  std::array<contact::SlipTotal, contact::kBlocks> totals{};  // at the starts of blocks, the newest before next_block
  contact::BeliefMeter belief;
  Real bent_square_m2ps2 = 0;    // mean square of what a sample's trapezoid leaves out
  Real rate_square_rad2ps2 = 0;  // mean over 0.5 s
  Real slip_score = 0;           // greatest speed by the accelerometer of a window, in its threshold, confirmed or not
  Real light_s = 0;              // for which N has been too small
  MeasuredContact newest;
};

void reset(const BallParams& ball, const EstimationParams& params, ContactMeter& meter);

// Once per control tick, in order. `commanded`, `masses`: the masses' motion at the start of this tick, as commanded
// and as known (measured_masses.h). `estimate`: attitude and gyro bias of this tick, from the filter or from a sensed
// attitude. `tick`: this one. Slip is judged by motion alone, and no coefficient of friction enters: the floor may have
// changed.
void measure_contact(const BallParams& ball, const EstimationParams& params, Wide control_period_s,
                     const Sensors& sensors, const MassMotion& commanded, const MassMotion& masses,
                     const Estimate& estimate, std::int64_t tick, ContactMeter& meter, MeasuredContact& out);

}  // namespace ballast::firmware
