// The filter on board: attitude, rate, the gyro's bias and place from raw IMU samples, places from outside and the
// masses' motion. Derivation and measured figures: tools/docs/estimation.md.
//
// Time. The filter's state is that of an anchor, the tick of the newest sample used. From there to the present tick the
// model carries it on: through the sample's latency, between samples, and where samples stay away.
//
// Between two samples the gyro turns the attitude, and the ball rolls: zdot = omega x r e3. Over a window of about
// sqrt(r / g) the accelerometer's specific force, turned into space and integrated, is the change of that same velocity
// less gravity. What is missing is an error of tilt or of the accelerometer. So the accelerometer is compensated by the
// acceleration that the gyro has measured, which has the swing of the steppers' masses in it and needs no mass. At the
// end of a window the covariance is advanced, and with the next sample corrected.
//
// Before tick 0 the ball is held still, as long as the signals do not deny it. There the gyro reads its bias, and the
// first sample of the accelerometer aligns the tilt.
//
// Samples that are not numbers, at the end of their range, repeated bit by bit or far from their neighbours are left
// out. The estimate stays finite and bounded whatever comes, and its band grows.
//
// No heap, no loop whose length depends on data. Called from one thread.
#pragma once

#include "firmware/estimation/error_covariance.h"
#include "firmware/estimation/estimate.h"
#include "firmware/estimation/history.h"
#include "firmware/estimation/sensors.h"
#include "firmware/model/ball.h"

namespace ballast::firmware {

namespace estimation {

// Watches one triad for samples that are none.
struct TriadWatch {
  Vector3 last = Vector3::Zero();  // as read
  std::array<int, 3> repeated{};   // samples on end in which the axis has read the same
  int rejected = 0;                // samples on end that were too far from their neighbours
};

// Sums over the samples of a window, from its start to the anchor.
struct Window {
  bool closed = false;  // the covariance is that of the anchor, and the measurements are still to be taken in
  int samples = 0;
  int without_gyro = 0, without_accelerometer = 0;
  Real time_s = 0;
  // At the start.
  Matrix3 orientation_start = Matrix3::Identity();
  Vector3 rate_start_B_radps = Vector3::Zero();
  // Integrals, of the attitude Lambda, the rate Omega (body) or omega (space), and the specific force f.
  Matrix3 orientation = Matrix3::Zero();    // Lambda
  Matrix3 turn_by_axis = Matrix3::Zero();   // Lambda diag(Omega)
  Vector3 turn_W_rad = Vector3::Zero();     // omega
  Vector3 force_W_mps = Vector3::Zero();    // Lambda f
  Matrix3 force_by_axis = Matrix3::Zero();  // Lambda diag(f)
  Matrix3 force_by_turn = Matrix3::Zero();  // Lambda f^
  Real step_squares_s2 = 0;                 // of the times between samples
  Real turn_variance = 0;                   // noise of the turn about each axis, rad^2
  // Held only.
  Vector3 reading_B_radps = Vector3::Zero();          // sum of the gyro's readings less the bias
  Vector3 reading_squares_rad2ps2 = Vector3::Zero();  // sum of squares
  // Once closed, in the hold.
  bool moved = false;    // not at rest
  bool believed = true;  // no axis of the gyro was too far off
  Errors found{};        // by the gyro; apply() takes them with the accelerometer's
};

}  // namespace estimation

// Plain data; reset() makes it valid.
struct FilterState {
  bool aligned = false;  // a sample has come
  bool held = false;     // the anchor is in the hold, and nothing moves
  std::int64_t anchor_tick = 0;
  std::int64_t imu_count = 0, fix_count = 0;

  // The estimate, at the anchor.
  Quaternion orientation{1, 0, 0, 0};
  Vector3 rate_B_radps = Vector3::Zero();
  Vector3 gyro_bias_B_radps = Vector3::Zero();
  Vector3 accelerometer_bias_B_mps2 = Vector3::Zero();
  std::array<Wide, 2> position_W_m{};
  estimation::Covariance covariance;  // at the start of the window, or at the end of a closed one

  std::array<Wide, 2> travel_W_m{};            // as integrated, never corrected
  Vector3 force_B_mps2 = Vector3::Zero();      // specific force of the newest sample used
  Real outage_s = 0;                           // time since the gyro was last heard
  int refused_windows = 0, refused_fixes = 0;  // on end
  estimation::TriadWatch gyro, accelerometer;
  estimation::Window window;

  // The model's integral of Omegadot and the integral of that, at the present tick; from there, what they were.
  std::array<Wide, 6> model{};
  std::array<Wide, 6> model_at_anchor{};
  estimation::History<6> models;
  estimation::History<2> travels;
};

// Before the first update().
void reset(const BallParams& ball, const EstimationParams& params, FilterState& state);

// Once per control tick, in order. `masses`: the masses' motion at the start of this tick as commanded. `out` is the
// estimate at the start of this tick.
void update(const BallParams& ball, const EstimationParams& params, Wide control_period_s, const Sensors& sensors,
            const MassMotion& masses, std::int64_t tick, FilterState& state, Estimate& out);

}  // namespace ballast::firmware
