#include "firmware/estimation/attitude_filter.h"

#include <cmath>

#include "firmware/model/rolling.h"

namespace ballast::firmware {

using namespace estimation;

namespace {

// --- constants; estimation.md says where they come from ---

// The window in units of sqrt(r / g), and its bounds in samples.
constexpr Real kWindow = 1;
constexpr int kLeastSamples = 8, kMostSamples = 2000;
// Prior of the tilt: before the first sample of the accelerometer aligns it, and where none can.
constexpr Real kTiltToAlign_rad = Real(0.3), kTiltUnaligned_rad = Real(0.1);
// The model's angular acceleration is off by this, in g / r.
constexpr Real kModelError = Real(0.02);
// Error of a window's sum of accelerations, in g times the time between samples: the masses' swing between samples.
constexpr Real kJitter = Real(0.15);
// A sample may differ from what is expected by these sigmas of its noise, and by so much real change: of the rate in
// g / r times the time since, of the specific force in g.
constexpr Real kSampleSigmas = 8, kRateChange = 4, kForceChange = 1;
constexpr int kMostRejected = 20;  // then it is a change
constexpr int kMostRepeated = 10;  // then the triad is stuck
constexpr int kSampleShare = 10;   // at most one in so many samples of a window may be missing
constexpr Real kGate_sigmas = 5;   // of an innovation
constexpr Real kQuiet_sigmas = 5;  // of the gyro at rest
constexpr int kMostRefusedFixes = 3;
constexpr Real kRefusedTilt_rad = Real(0.02);  // tilt that a refused window may mean, times the refused on end
constexpr int kMostRefusedWindows = 5;
constexpr Real kFixFloor = Real(1e-4);                      // error of the travel since a fix, in radii
constexpr Real kMostAngle_rad = 3, kMostPlace = Real(1e6);  // 1 sigma at most: rad, radii

Real square(Real x) { return x * x; }

Real noise_variance(const TriadErrors& triad) { return square(triad.noise) + square(triad.resolution) / 12; }

// g / r.
Real stiffness(const BallParams& ball) { return ball.gravity_mps2 > 0 ? ball.gravity_mps2 / ball.radius_m : Real(1); }

Matrix3 crossing(const Vector3& v) {
  Matrix3 m;
  m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return m;
}

// Columns of m times the components of v.
Matrix3 scaled(const Matrix3& m, const Vector3& v) {
  Matrix3 product;
  for (int j = 0; j < 3; ++j) product.col(j) = v[j] * m.col(j);
  return product;
}

bool finite(const Vector3& v) { return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]); }

// The turn by an angle vector; exact to angle^6 / 46080, and a turn whatever the angle.
Quaternion turned(const Vector3& angle_rad) {
  const Real a2 = angle_rad.squaredNorm();
  const Real part = Real(0.5) - a2 / 48 + a2 * a2 / 3840;
  Quaternion q(1 - a2 / 8 + a2 * a2 / 384, part * angle_rad[0], part * angle_rad[1], part * angle_rad[2]);
  q.normalize();
  return q;
}

Vector3 bounded(Vector3 v, Real most) {
  for (int j = 0; j < 3; ++j) v[j] = std::fmin(std::fmax(v[j], -most), most);
  return v;
}

// The rate that no ball exceeds.
Real most_rate(const BallParams& ball, const EstimationParams& params) {
  return params.gyro.range > 0 ? params.gyro.range : 100 * std::sqrt(stiffness(ball));
}

// From the contact to the accelerometer, space frame.
Vector3 lever_W(const BallParams& ball, const EstimationParams& params, const Matrix3& orientation) {
  Vector3 lever = orientation * params.accelerometer_position_B_m;
  lever[2] += ball.radius_m;
  return lever;
}

void begin_window(FilterState& s) {
  s.window = Window{};
  s.window.orientation_start = s.orientation.toRotationMatrix();
  s.window.rate_start_B_radps = s.rate_B_radps;
}

// --- samples ---

struct Judged {
  bool good = false;
  bool jumped = false;  // good, after many that were not believed
};

Judged judge(const TriadErrors& triad, const Vector3& reading, const Vector3& expected, Real change,
             TriadWatch& watch) {
  if (!finite(reading)) return {};
  bool good = true;
  const bool never_repeats = triad.noise > 0 && triad.noise >= triad.resolution;
  for (int j = 0; j < 3; ++j) {
    int& repeated = watch.repeated[static_cast<std::size_t>(j)];
    repeated = reading[j] == watch.last[j] ? std::min(repeated + 1, kMostRepeated) : 0;
    if (never_repeats && repeated >= kMostRepeated) good = false;
    if (triad.range > 0 && std::fabs(reading[j]) > triad.range - triad.resolution) good = false;
  }
  watch.last = reading;
  const Real most = change + kSampleSigmas * std::sqrt(noise_variance(triad)) + triad.resolution;
  const Vector3 off = reading - expected;
  const bool near = std::fabs(off[0]) <= most && std::fabs(off[1]) <= most && std::fabs(off[2]) <= most;
  if (!good) return {};
  if (near) {
    watch.rejected = 0;
    return {true, false};
  }
  if (++watch.rejected <= kMostRejected) return {};
  watch.rejected = 0;
  return {true, true};
}

// --- measurements ---

// Adds what a measurement has found to the estimate, which the filter's next sums start from.
void apply(const EstimationParams& params, const Errors& found, FilterState& s) {
  const auto part = [&found](std::size_t first) { return Vector3(found[first], found[first + 1], found[first + 2]); };
  const auto most = [](const TriadErrors& triad) { return 100 * triad.bias + 10 * triad.noise; };
  const Vector3 turn_W_rad = bounded(part(kAttitude), 1);
  s.orientation = turned(turn_W_rad) * s.orientation;
  turn_errors(turn_W_rad, s.covariance);
  s.orientation.normalize();
  const Vector3 gyro_bias = s.gyro_bias_B_radps, accelerometer_bias = s.accelerometer_bias_B_mps2;
  s.gyro_bias_B_radps = bounded(gyro_bias + part(kGyroBias), most(params.gyro));
  s.accelerometer_bias_B_mps2 = bounded(accelerometer_bias + part(kAccelerometerBias), most(params.accelerometer));
  if (!s.held) s.rate_B_radps -= s.gyro_bias_B_radps - gyro_bias;
  s.force_B_mps2 -= s.accelerometer_bias_B_mps2 - accelerometer_bias;
  for (std::size_t j = 0; j < 2; ++j) s.position_W_m[j] += static_cast<Wide>(found[kPlace + j]);
}

// Turns what the window has summed so far with an attitude that is corrected in its middle.
void turn_window(const Matrix3& turn_W, Window& w) {
  w.orientation_start = turn_W * w.orientation_start;
  w.orientation = turn_W * w.orientation;
  w.turn_by_axis = turn_W * w.turn_by_axis;
  w.turn_W_rad = turn_W * w.turn_W_rad;
  w.force_W_mps = turn_W * w.force_W_mps;
  w.force_by_axis = turn_W * w.force_by_axis;
  w.force_by_turn = turn_W * w.force_by_turn;
}

// The accelerometer over a window (or a sample, for alignment): what the ball's velocity gains beside gravity.
struct Force {
  Real time_s = 0;
  Vector3 sum_W_mps;     // integral of Lambda f
  Matrix3 orientation;   // of Lambda
  Matrix3 by_axis;       // of Lambda diag(f)
  Matrix3 by_turn;       // of Lambda f^
  Vector3 gained_W_mps;  // velocity of the accelerometer, at the end less at the start
  Matrix3 gained_by_attitude, gained_by_bias, gained_by_scale, gained_by_axes;
  Real floor_variance = 0, upright_variance = 0;  // of the components in the floor, and of that along e3
};

// The velocity omega x (r e3 + Lambda d) of the accelerometer and its derivatives by the errors, times `sign`.
void add_gain(const BallParams& ball, const EstimationParams& params, const Matrix3& orientation, const Vector3& rate_B,
              Real sign, Force& force) {
  const Vector3 omega = orientation * rate_B, lever = lever_W(ball, params, orientation);
  const Matrix3 lever_cross = crossing(lever), omega_cross = crossing(omega);
  const Vector3 arm = lever - Vector3(0, 0, ball.radius_m);
  const Matrix3 by_bias = lever_cross * orientation;
  force.gained_W_mps += sign * omega.cross(lever);
  force.gained_by_attitude += sign * (lever_cross * omega_cross - omega_cross * crossing(arm));
  force.gained_by_bias += sign * by_bias;
  force.gained_by_scale += sign * scaled(by_bias, rate_B);
  force.gained_by_axes -= sign * (by_bias * crossing(rate_B));
}

// Corrects with the three components. False: one was too far off.
bool correct_with(const BallParams& ball, const Force& force, Covariance& covariance, Errors& found) {
  const Vector3 gravity = ball.gravity_mps2 * ball.down_W;
  // A tilt turns the expected sum, not the measured one: that one changes with the bias found, and with changing
  // derivatives a filter at rest finds a tilt that it cannot see.
  const Vector3 expected = force.gained_W_mps - force.time_s * gravity;
  const Vector3 innovation = expected - force.sum_W_mps;
  const Matrix3 by_attitude = -crossing(expected) - force.gained_by_attitude;
  // Beyond first order in tilt t and yaw y: a bias turned by the tilt; along e3 the loss of g t^2 / 2; across it g t y
  // / 2 and g t^3 / 6. All are noise to a linear filter, that would take them for what it sees, and be sure too early.
  const auto& xx = covariance.xx;
  const Real tilt2 = xx[0][0] + xx[1][1];
  const Real bias2 = std::fmax(std::fmax(xx[6][6], xx[7][7]), xx[8][8]);
  const Real turned_bias = square(force.time_s) * tilt2 * bias2;
  const Real weight2 = square(force.time_s * ball.gravity_mps2);
  const Real upright = turned_bias + weight2 * square(tilt2) / 2;
  const Real across = turned_bias + weight2 * tilt2 * (xx[2][2] / 4 + square(tilt2) / 12);
  bool all = true;
  for (int i = 0; i < 3; ++i) {
    Measurement m;
    for (int j = 0; j < 3; ++j) {
      const auto k = static_cast<std::size_t>(j);
      m.hx[kAttitude + k] = by_attitude(i, j);
      m.hx[kGyroBias + k] = -force.gained_by_bias(i, j);
      m.hx[kAccelerometerBias + k] = -force.orientation(i, j);
      m.hc[kGyroScale + k] = -force.gained_by_scale(i, j);
      m.hc[kGyroAxes + k] = -force.gained_by_axes(i, j);
      m.hc[kAccelerometerScale + k] = -force.by_axis(i, j);
      m.hc[kAccelerometerAxes + k] = force.by_turn(i, j);
    }
    m.innovation = innovation[i];
    m.variance = i < 2 ? force.floor_variance + across : force.upright_variance + upright;
    if (!correct(m, kGate_sigmas, covariance, found)) all = false;
  }
  return all;
}

Force still(const Window& w) {
  Force force;
  force.time_s = w.time_s;
  force.sum_W_mps = w.force_W_mps;
  force.orientation = w.orientation;
  force.by_axis = w.force_by_axis;
  force.by_turn = w.force_by_turn;
  force.gained_W_mps.setZero();
  force.gained_by_attitude.setZero();
  force.gained_by_bias.setZero();
  force.gained_by_scale.setZero();
  force.gained_by_axes.setZero();
  return force;
}

// Whether the gyro reads its bias and nothing else. The window has samples of it.
bool quiet(const EstimationParams& params, const Window& w, const FilterState& s) {
  const Real n = static_cast<Real>(w.samples - w.without_gyro), noise = noise_variance(params.gyro);
  for (int j = 0; j < 3; ++j) {
    const auto k = kGyroBias + static_cast<std::size_t>(j);
    const Real mean = w.reading_B_radps[j] / n, spread = w.reading_squares_rad2ps2[j] / n - mean * mean;
    if (square(mean) > square(kQuiet_sigmas) * (s.covariance.xx[k][k] + noise / n)) return false;
    if (spread > noise * (1 + kQuiet_sigmas * std::sqrt(2 / n)) + square(params.gyro.resolution)) return false;
  }
  return true;
}

// The gyro over a window of the hold: its mean is its bias. If the ball was moved, it has turned by what the gyro says.
void correct_with_gyro(const EstimationParams& params, FilterState& s) {
  Window& w = s.window;
  const Real n = static_cast<Real>(w.samples - w.without_gyro);
  if (n < 1) return;
  if (!quiet(params, w, s)) {
    const Vector3 turn_rad = (w.time_s / n) * w.reading_B_radps;
    s.orientation = s.orientation * turned(bounded(turn_rad, 1));
    s.orientation.normalize();
    for (std::size_t j = 0; j < 3; ++j) s.covariance.xx[j][j] += Real(0.01) * turn_rad.squaredNorm();
    w.moved = true;
    return;
  }
  for (std::size_t j = 0; j < 3; ++j) {
    Measurement m;
    m.hx[kGyroBias + j] = 1;
    m.innovation = w.reading_B_radps[static_cast<int>(j)] / n;
    m.variance = noise_variance(params.gyro) / n;
    if (!correct(m, kGate_sigmas, s.covariance, w.found)) w.believed = false;
  }
}

// The accelerometer over a window of the hold: it reads the weight.
bool correct_held(const BallParams& ball, const EstimationParams& params, FilterState& s, Errors& found) {
  const Window& w = s.window;
  if (w.moved || w.without_gyro == w.samples || kSampleShare * w.without_accelerometer > w.samples) return w.believed;
  Force force = still(w);
  force.floor_variance = force.upright_variance = noise_variance(params.accelerometer) * w.step_squares_s2;
  return correct_with(ball, force, s.covariance, found) && w.believed;
}

bool correct_rolling(const BallParams& ball, const EstimationParams& params, FilterState& s, Errors& found) {
  const Window& w = s.window;
  if (kSampleShare * std::max(w.without_gyro, w.without_accelerometer) > w.samples) return true;
  Force force = still(w);
  add_gain(ball, params, s.orientation.toRotationMatrix(), s.rate_B_radps, 1, force);
  add_gain(ball, params, w.orientation_start, w.rate_start_B_radps, -1, force);
  const Real gyro = noise_variance(params.gyro), arm2 = params.accelerometer_position_B_m.squaredNorm();
  const Real reach = ball.radius_m + std::sqrt(arm2);
  const Real jitter = kJitter * ball.gravity_mps2 * w.time_s / static_cast<Real>(w.samples);
  const Real common = noise_variance(params.accelerometer) * w.step_squares_s2 + square(jitter);
  force.floor_variance = common + 2 * square(reach) * gyro;
  force.upright_variance = common + 2 * arm2 * gyro;
  return correct_with(ball, force, s.covariance, found);
}

void forget_everything(const BallParams& ball, const EstimationParams& params, FilterState& s);

bool sound(const FilterState& s) {
  Real sum = s.orientation.squaredNorm() + s.rate_B_radps.sum() + s.gyro_bias_B_radps.sum() +
             s.accelerometer_bias_B_mps2.sum() + s.force_B_mps2.sum() + static_cast<Real>(s.position_W_m[0]) +
             static_cast<Real>(s.position_W_m[1]);
  for (std::size_t i = 0; i < kErrors; ++i) sum += s.covariance.xx[i][i];
  return std::isfinite(sum) && s.orientation.squaredNorm() > Real(0.5);
}

void bound(const BallParams& ball, const EstimationParams& params, FilterState& s) {
  for (std::size_t j = 0; j < 3; ++j) {
    limit(kAttitude + j, square(kMostAngle_rad), s.covariance);
    limit(kGyroBias + j, square(100 * params.gyro.bias + 10 * params.gyro.noise), s.covariance);
    limit(kAccelerometerBias + j, square(100 * params.accelerometer.bias + 10 * params.accelerometer.noise),
          s.covariance);
  }
  for (std::size_t j = 0; j < 2; ++j) limit(kPlace + j, square(kMostPlace * ball.radius_m), s.covariance);
  if (!sound(s)) forget_everything(ball, params, s);
}

void advance_to_anchor(const BallParams& ball, const EstimationParams& params, FilterState& s) {
  Window& w = s.window;
  Covariance& covariance = s.covariance;
  if (!s.held) {
    advance({w.orientation, w.turn_by_axis, s.orientation.toRotationMatrix() - w.orientation_start, w.turn_W_rad,
             ball.radius_m, w.turn_variance},
            covariance);
  }
  for (std::size_t j = 0; j < 3; ++j) {
    covariance.xx[kGyroBias + j][kGyroBias + j] += square(params.gyro.bias_walk) * w.time_s;
    covariance.xx[kAccelerometerBias + j][kAccelerometerBias + j] += square(params.accelerometer.bias_walk) * w.time_s;
  }
  w.turn_variance = 0;
}

// Advances the covariance to the anchor, and in the hold takes in the gyro. The accelerometer is taken in before the
// next sample, so that no tick has all the work.
void close_window(const BallParams& ball, const EstimationParams& params, FilterState& s) {
  advance_to_anchor(ball, params, s);
  if (s.held) correct_with_gyro(params, s);
  s.window.closed = true;
}

// Takes in what a closed window has measured, and begins the next.
void use_window(const BallParams& ball, const EstimationParams& params, FilterState& s) {
  Errors found = s.window.found;
  const bool believed = s.held ? correct_held(ball, params, s, found) : correct_rolling(ball, params, s, found);
  apply(params, found, s);
  s.refused_windows = believed ? 0 : std::min(s.refused_windows + 1, kMostRefusedWindows);
  if (!believed) {
    const Real may_be = square(kRefusedTilt_rad * static_cast<Real>(s.refused_windows));
    for (std::size_t j = 0; j < 2; ++j) s.covariance.xx[j][j] += may_be;
  }
  bound(ball, params, s);
  begin_window(s);
}

int samples_per_window(const BallParams& ball, Real sample_s) {
  const Real samples = kWindow / (std::sqrt(stiffness(ball)) * sample_s);
  if (!(samples > static_cast<Real>(kLeastSamples))) return kLeastSamples;
  return samples < static_cast<Real>(kMostSamples) ? static_cast<int>(samples) : kMostSamples;
}

// --- from sample to sample ---

// One sample; null where a triad has none that is believed.
struct Sample {
  std::int64_t tick = 0;
  const Vector3* gyro = nullptr;
  const Vector3* accelerometer = nullptr;
  Real extra_turn_variance = 0;
};

Vector3 part_of(const std::array<Wide, 6>& model, std::size_t first) {
  return {static_cast<Real>(model[first]), static_cast<Real>(model[first + 1]), static_cast<Real>(model[first + 2])};
}

// Noise of the turn in a step.
Real turn_variance(const BallParams& ball, const EstimationParams& params, bool heard, Real dt_s, FilterState& s) {
  const Real half = kModelError * stiffness(ball) / 2;
  if (heard) {
    s.outage_s = 0;
    return noise_variance(params.gyro) * square(dt_s) + square(half * square(dt_s)) / 4;
  }
  // The error half tau^2 of the model is one and the same all the time.
  const Real before = square(half * square(s.outage_s)), after = square(half * square(s.outage_s + dt_s));
  s.outage_s = std::fmin(s.outage_s + dt_s, Real(1e3));
  return after - before;
}

void roll(const BallParams& ball, const Vector3& rate_B_radps, Real dt_s, FilterState& s) {
  const Vector3 mean_B_radps = Real(0.5) * (s.rate_B_radps + rate_B_radps);
  const Vector3 before_W = s.orientation * s.rate_B_radps;
  s.orientation = s.orientation * turned(dt_s * mean_B_radps);
  s.orientation.normalize();
  s.rate_B_radps = rate_B_radps;
  const Vector3 turn_W = (dt_s / 2) * (before_W + s.orientation * rate_B_radps);
  const Real r = ball.radius_m;
  const std::array<Wide, 2> step{static_cast<Wide>(r * turn_W[1]), static_cast<Wide>(-r * turn_W[0])};
  for (std::size_t j = 0; j < 2; ++j) {
    s.travel_W_m[j] += step[j];
    s.position_W_m[j] += step[j];
  }
  s.window.turn_W_rad += turn_W;
}

void add_to_window(const Sample& sample, const Vector3& force_before_W, const Matrix3& orientation, Real dt_s,
                   FilterState& s) {
  Window& w = s.window;
  ++w.samples;
  w.time_s += dt_s;
  w.step_squares_s2 += square(dt_s);
  if (sample.accelerometer == nullptr) ++w.without_accelerometer;
  if (sample.gyro == nullptr) ++w.without_gyro;
  const Matrix3 step = dt_s * orientation;
  w.orientation += step;
  w.force_W_mps += (dt_s / 2) * (force_before_W + orientation * s.force_B_mps2);
  w.force_by_axis += scaled(step, s.force_B_mps2);
  w.force_by_turn += step * crossing(s.force_B_mps2);
  if (!s.held) w.turn_by_axis += scaled(step, s.rate_B_radps);
  if (s.held && sample.gyro != nullptr) {
    const Vector3 reading = *sample.gyro - s.gyro_bias_B_radps;
    w.reading_B_radps += reading;
    w.reading_squares_rad2ps2 += reading.cwiseProduct(reading);
  }
}

// Moves the anchor to the sample.
void step_to(const BallParams& ball, const EstimationParams& params, Wide control_period_s, const Sample& sample,
             FilterState& s) {
  Real dt_s = static_cast<Real>(static_cast<Wide>(sample.tick - s.anchor_tick) * control_period_s);
  const auto model = s.models.at(sample.tick);
  const Vector3 gained = part_of(model, 0) - part_of(s.model_at_anchor, 0);
  s.model_at_anchor = model;
  s.anchor_tick = sample.tick;

  const bool released = s.held && sample.tick >= 0;
  if (s.window.closed) {
    use_window(ball, params, s);
  } else if (released) {
    advance_to_anchor(ball, params, s);  // what the window has measured is lost: the last sample before was late
  }
  if (released) {
    s.held = false;
    dt_s = static_cast<Real>(static_cast<Wide>(sample.tick) * control_period_s);
  }
  const Vector3 force_before_W = s.orientation * s.force_B_mps2;
  if (!s.held) {
    const Vector3 rate =
        sample.gyro != nullptr ? Vector3(*sample.gyro - s.gyro_bias_B_radps) : Vector3(s.rate_B_radps + gained);
    // Held until tick 0, and then set free with the rate it has.
    if (released) s.rate_B_radps = rate;
    s.window.turn_variance += turn_variance(ball, params, sample.gyro != nullptr, dt_s, s) + sample.extra_turn_variance;
    roll(ball, bounded(rate, most_rate(ball, params)), dt_s, s);
  }
  const Matrix3 orientation = s.orientation.toRotationMatrix();
  if (sample.accelerometer != nullptr) {
    s.force_B_mps2 = *sample.accelerometer - s.accelerometer_bias_B_mps2;
  } else {
    s.force_B_mps2 = orientation.transpose() * force_before_W;
  }
  s.travels.add(s.anchor_tick, s.travel_W_m);
  if (released) return begin_window(s);

  add_to_window(sample, force_before_W, orientation, dt_s, s);
  const Window& w = s.window;
  const int enough = samples_per_window(ball, w.time_s / static_cast<Real>(w.samples));
  const bool both = sample.gyro != nullptr && sample.accelerometer != nullptr;
  const bool full = w.samples >= enough && (both || w.samples >= 2 * enough);
  const bool last_held = s.held && sample.tick + params.imu_period_ticks >= 0;
  if (full || last_held) close_window(ball, params, s);
}

// --- beginning ---

// Prior of the attitude: unknown but for turns about the vertical.
void set_tilt_prior(const BallParams& ball, Real sigma_rad, Covariance& covariance) {
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      const Real along = ball.down_W[static_cast<int>(i)] * ball.down_W[static_cast<int>(j)];
      covariance.xx[i][j] = square(sigma_rad) * ((i == j ? Real(1) : Real(0)) - along);
    }
  }
}

// The shortest turn that makes the specific force point up.
void align(const BallParams& ball, const Vector3& force_B_mps2, FilterState& s) {
  Vector3 is_W = s.orientation * force_B_mps2;
  const Real size = is_W.norm();
  if (!(size > 0)) return;
  is_W /= size;
  const Vector3 up_W = -ball.down_W, axis = is_W.cross(up_W);
  const Real w = 1 + is_W.dot(up_W);
  if (w < Real(1e-3)) return;
  s.orientation = Quaternion(w, axis[0], axis[1], axis[2]).normalized() * s.orientation;
  s.orientation.normalize();
}

void begin(const BallParams& ball, const EstimationParams& params, const Sample& sample, FilterState& s) {
  s.aligned = true;
  s.anchor_tick = sample.tick;
  s.model_at_anchor = s.models.at(sample.tick);
  s.held = sample.tick < 0;
  s.force_B_mps2 = *sample.accelerometer;
  s.rate_B_radps = s.held ? Vector3(Vector3::Zero()) : *sample.gyro;
  set_tilt_prior(ball, s.held ? kTiltToAlign_rad : kTiltUnaligned_rad, s.covariance);
  if (s.held && ball.gravity_mps2 > 0) {
    align(ball, s.force_B_mps2, s);
    Window one;
    one.time_s = 1;
    one.orientation = s.orientation.toRotationMatrix();
    one.force_W_mps = one.orientation * s.force_B_mps2;
    one.force_by_axis = scaled(one.orientation, s.force_B_mps2);
    one.force_by_turn = one.orientation * crossing(s.force_B_mps2);
    Force force = still(one);
    force.floor_variance = force.upright_variance = noise_variance(params.accelerometer);
    Errors found{};
    // A force that is far from g is no reason to believe the prior.
    static_cast<void>(correct_with(ball, force, s.covariance, found));
    apply(params, found, s);
  }
  s.travels.add(s.anchor_tick, s.travel_W_m);
  begin_window(s);
}

void set_priors(const EstimationParams& params, Covariance& covariance) {
  covariance = Covariance{};
  for (std::size_t j = 0; j < 3; ++j) {
    covariance.xx[kGyroBias + j][kGyroBias + j] = square(params.gyro.bias);
    covariance.xx[kAccelerometerBias + j][kAccelerometerBias + j] = square(params.accelerometer.bias);
    covariance.cc[kGyroScale + j] = square(params.gyro.scale_error);
    covariance.cc[kGyroAxes + j] = square(params.gyro.misalignment_rad);
    covariance.cc[kAccelerometerScale + j] = square(params.accelerometer.scale_error);
    covariance.cc[kAccelerometerAxes + j] = square(params.accelerometer.misalignment_rad);
  }
}

// After something that is no number has come in, against all checks: nothing is known, and the band says so.
void forget_everything(const BallParams& ball, const EstimationParams& params, FilterState& s) {
  s.orientation = params.initial_orientation;
  s.rate_B_radps.setZero();
  s.gyro_bias_B_radps.setZero();
  s.accelerometer_bias_B_mps2.setZero();
  s.force_B_mps2.setZero();
  for (std::size_t j = 0; j < 2; ++j) {
    s.position_W_m[j] = static_cast<Wide>(params.initial_position_W_m[static_cast<int>(j)]);
    s.travel_W_m[j] = 0;
  }
  set_priors(params, s.covariance);
  for (std::size_t j = 0; j < 3; ++j) forget(kAttitude + j, square(kMostAngle_rad), s.covariance);
  for (std::size_t j = 0; j < 2; ++j) forget(kPlace + j, square(kMostPlace * ball.radius_m), s.covariance);
}

// --- sensors ---

// A new sample, of a tick that can be right. Count and tick of a corrupted message can be anything: a wrong count must
// not hide the samples after it, and a first sample from long ago is none.
bool is_fresh(const EstimationParams& params, const Sensors& sensors, std::int64_t tick, const FilterState& s) {
  if (sensors.imu_count == s.imu_count || sensors.imu_tick > tick) return false;
  if (s.aligned) return sensors.imu_tick > s.anchor_tick;
  const std::uint64_t age = static_cast<std::uint64_t>(tick) - static_cast<std::uint64_t>(sensors.imu_tick);
  return age <=
         static_cast<std::uint64_t>(params.imu_latency_ticks) + static_cast<std::uint64_t>(params.imu_period_ticks);
}

void take_imu(const BallParams& ball, const EstimationParams& params, Wide control_period_s, const Sensors& sensors,
              std::int64_t tick, FilterState& s) {
  if (!is_fresh(params, sensors, tick, s)) {
    // Late: the model takes the sample's place.
    const bool late = s.aligned && tick - s.anchor_tick > params.imu_latency_ticks + params.imu_period_ticks;
    if (late) step_to(ball, params, control_period_s, {.tick = s.anchor_tick + 1}, s);
    return;
  }
  s.imu_count = sensors.imu_count;
  const Vector3 &gyro = sensors.gyro_B_radps, &accelerometer = sensors.accelerometer_B_mps2;
  if (!s.aligned) {
    const Judged a = judge(params.gyro, gyro, gyro, 0, s.gyro);
    const Judged b = judge(params.accelerometer, accelerometer, accelerometer, 0, s.accelerometer);
    if (a.good && b.good) begin(ball, params, {sensors.imu_tick, &gyro, &accelerometer}, s);
    return;
  }

  const Real dt_s = static_cast<Real>(static_cast<Wide>(sensors.imu_tick - s.anchor_tick) * control_period_s);
  const bool release = s.held && sensors.imu_tick >= 0;
  const Vector3 model_gained = part_of(s.models.at(sensors.imu_tick), 0) - part_of(s.model_at_anchor, 0);
  // In the hold a hand may turn the ball: a sample is only held against the one before.
  const Vector3 expected = s.held ? s.gyro.last : Vector3(s.rate_B_radps + model_gained + s.gyro_bias_B_radps);
  const Real change = kRateChange * stiffness(ball) * dt_s;
  const Judged a = judge(params.gyro, gyro, release ? gyro : expected, change, s.gyro);
  const Judged b = judge(params.accelerometer, accelerometer,
                         release ? accelerometer : Vector3(s.force_B_mps2 + s.accelerometer_bias_B_mps2),
                         kForceChange * std::fmax(ball.gravity_mps2, ball.radius_m * stiffness(ball)), s.accelerometer);
  Sample sample{sensors.imu_tick, a.good ? &gyro : nullptr, b.good ? &accelerometer : nullptr, 0};
  // The samples that were not believed were true: the ball has turned by up to that meanwhile.
  if (a.jumped) {
    sample.extra_turn_variance = square(static_cast<Real>(kMostRejected) * dt_s) * (gyro - expected).squaredNorm();
  }
  step_to(ball, params, control_period_s, sample, s);
}

void take_fix(const BallParams& ball, const EstimationParams& params, Wide control_period_s, const Sensors& sensors,
              FilterState& s) {
  if (sensors.fix_count == s.fix_count || !s.aligned || sensors.fix_tick > s.anchor_tick) return;
  // Not in a tick that has a window's work.
  if (s.window.closed || s.window.samples < 2) return;
  s.fix_count = sensors.fix_count;
  const auto then = s.travels.at(sensors.fix_tick);
  // Without the gyro the travel since the fix is the model's.
  const Real late_s = static_cast<Real>(static_cast<Wide>(s.anchor_tick - sensors.fix_tick) * control_period_s);
  const Real heard_s = std::fmax(s.outage_s - late_s, Real(0));
  const Real unheard_rad = kModelError * stiffness(ball) / 2 * (square(s.outage_s) - square(heard_s));
  const Real unheard_m2 = square(ball.radius_m * unheard_rad);
  std::array<Measurement, 2> measured;
  std::array<Real, 2> since{};
  for (std::size_t j = 0; j < 2; ++j) {
    since[j] = static_cast<Real>(s.travel_W_m[j] - then[j]);
    measured[j].innovation = static_cast<Real>(sensors.fix_W_m[j] - (s.position_W_m[j] - (s.travel_W_m[j] - then[j])));
    measured[j].hx[kPlace + j] = 1;
    measured[j].variance = square(params.fix_noise_m) + square(kFixFloor * ball.radius_m) + unheard_m2;
    // A place beyond all bounds, or none at all, would replace the estimate after a few.
    if (!(std::fabs(measured[j].innovation) <= kMostPlace * ball.radius_m)) return;
  }
  // A yaw turns the travel since then.
  measured[0].hx[kAttitude + 2] = since[1];
  measured[1].hx[kAttitude + 2] = -since[0];
  Covariance& covariance = s.covariance;
  Errors found{};
  bool believed = true;
  for (const Measurement& m : measured) believed = correct(m, kGate_sigmas, covariance, found) && believed;
  if (!believed && ++s.refused_fixes > kMostRefusedFixes) {
    // It is the place that was wrong: the ball has slipped.
    for (std::size_t j = 0; j < 2; ++j) {
      found[kPlace + j] = measured[j].innovation;
      forget(kPlace + j, measured[j].variance, covariance);
    }
    believed = true;
  }
  if (believed) s.refused_fixes = 0;
  const Quaternion before = s.orientation;
  apply(params, found, s);
  turn_window((s.orientation * before.conjugate()).toRotationMatrix(), s.window);
  bound(ball, params, s);
}

// --- the present ---

// Carries the estimate from the anchor to the present tick, with bands.
void report(const BallParams& ball, Wide control_period_s, std::int64_t tick, const FilterState& s, Estimate& out) {
  const Real age_s = static_cast<Real>(static_cast<Wide>(tick - s.anchor_tick) * control_period_s);
  const Vector3 gained = part_of(s.model, 0) - part_of(s.model_at_anchor, 0);
  Vector3 turn_B_rad = age_s * s.rate_B_radps;
  for (std::size_t j = 0; j < 3; ++j) {
    turn_B_rad[static_cast<int>(j)] +=
        static_cast<Real>(s.model[3 + j] - s.model_at_anchor[3 + j] -
                          s.model_at_anchor[j] * (static_cast<Wide>(tick - s.anchor_tick) * control_period_s));
  }
  const Quaternion ahead = turned(Real(0.5) * turn_B_rad);
  const Vector3 turn_W_rad = (s.orientation * ahead) * turn_B_rad;
  out.valid = s.aligned;
  out.orientation = s.orientation * ahead * ahead;
  out.orientation.normalize();
  out.angular_velocity_B_radps = s.rate_B_radps + gained;
  out.gyro_bias_B_radps = s.gyro_bias_B_radps;
  const Real r = ball.radius_m;
  out.position_W_m = {static_cast<Real>(s.position_W_m[0]) + r * turn_W_rad[1],
                      static_cast<Real>(s.position_W_m[1]) - r * turn_W_rad[0]};

  const auto& p = s.covariance.xx;
  const Real half = kModelError * stiffness(ball) / 2;
  const Real since = s.window.turn_variance + square(half * square(age_s));
  out.tilt_sigma_rad = std::sqrt(std::fmax(p[0][0], p[1][1]) + since);
  out.yaw_sigma_rad = std::sqrt(p[2][2] + since);
  out.gyro_bias_sigma_radps = std::sqrt(std::fmax(std::fmax(p[3][3], p[4][4]), p[5][5]));
  const Real mean = (p[kPlace][kPlace] + p[kPlace + 1][kPlace + 1]) / 2;
  const Real half_difference = (p[kPlace][kPlace] - p[kPlace + 1][kPlace + 1]) / 2;
  const Real radius = std::sqrt(square(half_difference) + square(p[kPlace][kPlace + 1]));
  out.position_sigma_m = std::sqrt(mean + radius + square(r) * since);
}

// The model's integrals at the next tick.
void predict(const BallParams& ball, const EstimationParams& params, Wide control_period_s, const MassMotion& masses,
             std::int64_t tick, const Estimate& now, FilterState& s) {
  const bool rolls = s.aligned && tick >= 0;
  const bool needed =
      params.imu_latency_ticks > 0 || params.imu_period_ticks > 1 || s.anchor_tick < tick || s.outage_s > 0;
  Vector3 angular_acceleration = Vector3::Zero();
  if (rolls && needed) {
    angular_acceleration =
        rolling_forces(ball, now.orientation, now.angular_velocity_B_radps, masses).angular_acceleration_B_radps2;
    if (!finite(angular_acceleration)) angular_acceleration.setZero();
    angular_acceleration = bounded(angular_acceleration, 100 * stiffness(ball));
  }
  for (std::size_t j = 0; j < 3; ++j) {
    const Wide gain = static_cast<Wide>(angular_acceleration[static_cast<int>(j)]) * control_period_s;
    s.model[3 + j] += (s.model[j] + gain / 2) * control_period_s;
    s.model[j] += gain;
    // The ball is set free with this rate.
    if (tick == -1) s.model[j] += static_cast<Wide>(params.initial_angular_velocity_B_radps[static_cast<int>(j)]);
  }
}

}  // namespace

void reset(const BallParams& /*ball*/, const EstimationParams& params, FilterState& state) {
  state = FilterState{};
  state.orientation = params.initial_orientation;
  for (std::size_t j = 0; j < 2; ++j) {
    state.position_W_m[j] = static_cast<Wide>(params.initial_position_W_m[static_cast<int>(j)]);
  }
  set_priors(params, state.covariance);
  const std::int64_t late = params.imu_latency_ticks + params.imu_period_ticks + 1;
  state.models.reset(late);
  state.travels.reset(late + params.fix_delay_ticks);
}

void update(const BallParams& ball, const EstimationParams& params, Wide control_period_s, const Sensors& sensors,
            const MassMotion& masses, std::int64_t tick, FilterState& state, Estimate& out) {
  state.models.add(tick, state.model);
  if (!state.aligned) state.anchor_tick = tick;
  take_imu(ball, params, control_period_s, sensors, tick, state);
  take_fix(ball, params, control_period_s, sensors, state);
  report(ball, control_period_s, tick, state, out);
  predict(ball, params, control_period_s, masses, tick, out, state);
}

}  // namespace ballast::firmware
