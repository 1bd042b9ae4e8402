#include "firmware/estimation/measured_contact.h"

#include <cmath>
#include <limits>

namespace ballast::firmware {

namespace {

constexpr auto kTwoPi = static_cast<Real>(6.283185307179586);

// Observer of the rate: natural frequency and damping. Faster passes more of the gyro's noise, slower lets the force
// err for longer where slip begins.
constexpr Real kObserver = kTwoPi * 15;
constexpr auto kDamping = static_cast<Real>(0.7);
constexpr auto kGreatestStep = static_cast<Real>(0.3);  // natural frequency times the sample period

// Corner above which what Euler's equation leaves is taken for the masses' swing. Below it the swing is bounded by its
// amplitude, and errors of tilt and parameters prevail.
constexpr Real kSwingCorner = kTwoPi * Real(1.5);
constexpr auto kPowerTime_s = static_cast<Real>(0.05);
constexpr auto kSwingMemory_s = static_cast<Real>(0.6);  // of the swing's impulse: the longest window of slip
constexpr auto kLeastSwing = static_cast<Real>(2);       // per s^2, 1 sigma
// Angular acceleration about the vertical, of which the observer sees only the slow part. 1 sigma, rad/s^2.
constexpr auto kUnseenSpin = static_cast<Real>(30);

// Windows of slip and the baseline before them are those of belief_errors.h, in blocks.
constexpr auto kBlock_s = static_cast<Real>(0.01);
constexpr int kBaseline = contact::kBaselineEpochs * contact::kEpochBlocks;
constexpr int kLeastBaseline = contact::kLeastBaselineEpochs * contact::kEpochBlocks;
static_assert(contact::kBlocks >= kBaseline + contact::kWindowEpochs.back() * contact::kEpochBlocks);
constexpr int kLeastBlock = 3;  // samples in a block: between fewer the masses swing unseen
constexpr auto kLeastSlip_mps = static_cast<Real>(0.02);
// The same by rotation, where masses may lag behind their command by a part of a step.
constexpr auto kLeastTurned_mps = static_cast<Real>(0.025);
// A constant error is what it is for the whole run; noise is drawn anew in every window, of which an hour has a
// million.
constexpr auto kErrorSigmas = static_cast<Real>(4), kNoiseSigmas = static_cast<Real>(6);
// Errors of belief are drawn once for a robot. So many sigma of what is not known of them count in the threshold by
// rotation, and so many have to be exceeded beyond kConfirmed where rotation confirms the accelerometer.
constexpr auto kBeliefSigmas = static_cast<Real>(3.5), kBeliefConfirmed = static_cast<Real>(1.5);
// Part of a speed that the other measure has to show, for the accelerometer's and for that by rotation; and part of the
// other's that the accelerometer's has to be.
constexpr auto kConfirmed = static_cast<Real>(0.5), kTurnedConfirmed = static_cast<Real>(0.6),
               kAgreed = static_cast<Real>(0.25);
constexpr auto kMostConstant = static_cast<Real>(0.01);  // of g: an accelerometer that errs by more shows no slip
// The estimate of the attitude changes by its band in about this time.
constexpr auto kTiltRate_radps = static_cast<Real>(0.3);
constexpr auto kBentMemory = static_cast<Real>(0.01);  // of a sample in the mean square of what trapezoids leave out
constexpr auto kRateMemory = static_cast<Real>(0.02);  // of a block in the mean square of the rate
// A lever of the centre of mass about the contact point below this part of the radius confirms nothing.
constexpr auto kLeastLever = static_cast<Real>(0.2);

constexpr auto kLightPart = static_cast<Real>(0.2);
constexpr auto kLightSigmas = static_cast<Real>(3);

constexpr int kMostRepeats = 4;
constexpr int kLongestGap = 16;                        // samples
constexpr Real kGreatest = 0x1p50;                     // of a reading, as everywhere in the firmware
constexpr auto kNearRange = static_cast<Real>(0.999);  // of a sensor's range

// Regularises a matrix that may be singular, as a part of its trace: some roundings.
constexpr Real kRegular = 16 * std::numeric_limits<Real>::epsilon();

// A block of 10 ms has at least kLeastBlock samples (end_block()).
bool fills_blocks(Real dt) { return (static_cast<Real>(kLeastBlock) - Real(0.5)) * dt <= kBlock_s; }

Real square(Real x) { return x * x; }

// Standard deviation of a variance that rounding may have left below 0.
Real root(Real variance) { return variance > 0 ? std::sqrt(variance) : Real(0); }

// a - b, modulo 2^64: ticks of a message can be anything.
std::int64_t ticks_between(std::int64_t b, std::int64_t a) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}

Matrix3 hat(const Vector3& v) {
  Matrix3 m;
  m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return m;
}

// x^T S x.
Real along(const Matrix3& s, const Vector3& x) { return x.dot(Vector3(s * x)); }

bool usable(const TriadErrors& errors, const Vector3& reading, contact::Repeats& repeats) {
  // Noise below the resolution lets a ball at rest read the same for long.
  const bool never_repeats = errors.noise > 0 && errors.noise >= errors.resolution;
  const bool repeated = never_repeats && reading == repeats.reading;
  repeats.count = repeated ? repeats.count + (repeats.count < kMostRepeats ? 1 : 0) : 0;
  repeats.reading = reading;
  const Real range = errors.range > 0 ? kNearRange * errors.range : kGreatest;
  for (int j = 0; j < 3; ++j) {
    if (!(std::fabs(reading[j]) < range)) return false;
  }
  return repeats.count < kMostRepeats;
}

// The knowledge at the sample's time. `age_s`: from there to the tick of estimate and masses.
struct Instant {
  Instant(const BallParams& ball, const EstimationParams& params, const Sensors& sensors, const Estimate& estimate,
          Real age_s)
      : rate_B(sensors.gyro_B_radps - estimate.gyro_bias_B_radps), to_W(estimate.orientation.toRotationMatrix()) {
    if (age_s > 0) {
      const Matrix3 turned = age_s * to_W * hat(rate_B);
      to_W += age_s / 2 * turned * hat(rate_B) - turned;
    }
    up_B = to_W.row(2).transpose();
    gravity_B = ball.gravity_mps2 * (to_W.transpose() * ball.down_W);
    force_B = to_W.transpose() * ball.external_force_W_n;
    const Vector3& d = params.accelerometer_position_B_m;
    reading_B = sensors.accelerometer_B_mps2 - rate_B.cross(rate_B.cross(d));
  }

  Vector3 rate_B;
  Matrix3 to_W;       // Lambda
  Vector3 up_B;       // Gamma
  Vector3 gravity_B;  // Lambda^T g_W
  Vector3 force_B;    // Lambda^T F_e
  Vector3 reading_B;  // f + Omegadot x d
};

// Sums over shell and masses (the head of measured_contact.h).
struct ContactSums {
  explicit ContactSums(const BallParams& ball) : euler(ball.inertia_kgm2.asDiagonal()) {}

  void add(Real m, const Vector3& s, const Vector3& zeta, const Vector3& c) {
    mass += m;
    mass_zeta += m * zeta;
    mass_s += m * s;
    mass_c += m * c;
    moment_c += m * s.cross(c);
    const Vector3 m_zeta = m * zeta;
    euler += s.dot(m_zeta) * Matrix3::Identity() - m_zeta * s.transpose();
  }
  void add_swing(const Vector3& push, const Vector3& moment) {
    pushes += push * push.transpose();
    push_moments += push * moment.transpose();
    moments += moment * moment.transpose();
  }

  Real mass = 0;                        // M
  Vector3 mass_zeta = Vector3::Zero();  // sum m_i zeta_i
  Vector3 mass_s = Vector3::Zero();     // sum m_i s_i
  Vector3 mass_c = Vector3::Zero();     // sum m_i c_i
  Vector3 moment_c = Vector3::Zero();   // sum m_i s_i x c_i
  PerMass<Vector3> place_B;             // zeta_i; as many as there are masses
  Matrix3 euler;                        // A = I + sum m_i (s_i . zeta_i - zeta_i s_i^T)
  // sum z_i z_i^T, z_i b_i^T and b_i b_i^T with z_i = m_i zeta_i' and b_i = s_i x z_i.
  Matrix3 pushes = Matrix3::Zero(), push_moments = Matrix3::Zero(), moments = Matrix3::Zero();
};

ContactSums sums_of(const BallParams& ball, const Instant& now, const MassMotion& masses, Real age_s) {
  ContactSums sums(ball);
  const Vector3 r_up = ball.radius_m * now.up_B;
  const Vector3& omega = now.rate_B;
  const Vector3& chi = ball.center_of_mass_B_m;
  sums.add(ball.shell_mass_kg, r_up + chi, chi, omega.cross(omega.cross(chi)));
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Real acceleration = masses.acceleration[k], rate = masses.velocity[k] - age_s * acceleration;
    const Real position = masses.position[k] - age_s * (rate + age_s / 2 * acceleration);
    const RailPoint<Real> rail = evaluate<Real>(ball.rail[k], position);
    const Vector3 c =
        omega.cross(omega.cross(rail.position) + 2 * rate * rail.d1) + square(rate) * rail.d2 + acceleration * rail.d1;
    const Vector3 s = r_up + rail.position, push = ball.mass_kg[k] * rail.d1;
    sums.place_B[k] = rail.position;
    sums.add(ball.mass_kg[k], s, rail.position, c);
    sums.add_swing(push, s.cross(push));
  }
  return sums;
}

struct Acceleration {
  Vector3 specific_force_B;  // f
  Vector3 angular_B;         // Omegadot
};

// f and Omegadot, and the observer's step. Off the centre the accelerometer reads y = f + Omegadot x d, and Omegadot
// depends on f: Omegadot = Gamma x (f + g) / r + nu. With (Gamma x f) x d = (Gamma . d) f - (f . d) Gamma that is
//   (1 + Gamma . d / r) f - (f . d) Gamma / r = b,   b = y - (Gamma x g / r + nu) x d
// whose product with d gives f . d = b . d. |d| < r: validate() sees to it.
Acceleration observe(const BallParams& ball, const EstimationParams& params, const Instant& now, Real dt,
                     ContactMeter& meter) {
  const Vector3 arm = params.accelerometer_position_B_m / ball.radius_m;
  const Vector3 by_gravity = now.up_B.cross(now.gravity_B) + ball.radius_m * meter.correction_B_radps2;
  const Vector3 b = now.reading_B - by_gravity.cross(arm);
  const Vector3 f = (b + b.dot(arm) * now.up_B) / (1 + now.up_B.dot(arm));
  const Vector3 rolling = now.up_B.cross(f + now.gravity_B) / ball.radius_m;
  if (meter.followed) {
    const Real frequency = kObserver * dt < kGreatestStep ? kObserver : kGreatestStep / dt;
    meter.rate_B_radps += dt * ((rolling + meter.last.rolling_B_radps2) / 2 + meter.correction_B_radps2);
    const Vector3 error = now.rate_B - meter.rate_B_radps;
    meter.rate_B_radps += 2 * kDamping * frequency * dt * error;
    meter.correction_B_radps2 += square(frequency) * dt * error;
  } else {
    meter.rate_B_radps = now.rate_B;
  }
  meter.last.rolling_B_radps2 = rolling;
  return {f, rolling + meter.correction_B_radps2};
}

// The contact force and its covariance from everything but constant errors.
struct Force {
  Vector3 value_B;
  Matrix3 covariance_B;
};

Force force_of(const BallParams& ball, const EstimationParams& params, const Instant& now, const Acceleration& a,
               const ContactSums& sums, Real dt, ContactMeter& meter) {
  // The rest of Euler's equation, and its part above the corner.
  const Vector3& omega = now.rate_B;
  const Vector3 spin = ball.inertia_kgm2.cwiseProduct(omega);
  const Vector3 left = (ball.radius_m * now.up_B).cross(now.force_B) - sums.euler * a.angular_B - omega.cross(spin) -
                       sums.mass_s.cross(a.specific_force_B) - sums.moment_c;
  const Real blend = kSwingCorner * dt < 1 ? kSwingCorner * dt : Real(1);
  if (!meter.followed) meter.slow_moment_B_nm = left;
  meter.slow_moment_B_nm += blend * (left - meter.slow_moment_B_nm);
  const Vector3 fast = left - meter.slow_moment_B_nm;

  // Its noise: of f, which enters directly and by Omegadot, and of the correction.
  const Matrix3 up_hat = hat(now.up_B) / ball.radius_m;
  const Matrix3 by_f = -hat(sums.mass_s) - sums.euler * up_hat;
  const Real f_noise = square(params.accelerometer.noise);
  const Real correction_noise = square(params.gyro.noise) * dt * kObserver * square(kObserver);
  Matrix3 noise = f_noise * by_f * by_f.transpose() + correction_noise * sums.euler * sums.euler.transpose();

  // The impulse of `fast`: the masses' swing takes it from the ball and gives it back.
  meter.impulse_B_nms += dt * fast - blend * meter.impulse_B_nms;
  const Real impulse = meter.impulse_B_nms.squaredNorm() - square(meter.impulse_B_nms.dot(now.up_B));
  const Real faded = dt < kSwingMemory_s ? meter.impulse_power_n2m2s2 * (1 - dt / kSwingMemory_s) : Real(0);
  meter.impulse_power_n2m2s2 = impulse > faded ? impulse : faded;

  // The swing's mean square, from the horizontal part of the residual: what the noise does not explain.
  const Vector3& up = now.up_B;
  const Real vertical = fast.dot(up), seen = fast.squaredNorm() - square(vertical);
  const Real power_blend = dt < kPowerTime_s ? dt / kPowerTime_s : Real(1);
  meter.moment_power_n2m2 += power_blend * (seen - meter.moment_power_n2m2);
  const Real expected = noise.trace() - along(noise, up), gain = sums.moments.trace() - along(sums.moments, up);
  Real swing = square(kLeastSwing);
  if (gain > 0 && meter.moment_power_n2m2 > expected + swing * gain)
    swing = (meter.moment_power_n2m2 - expected) / gain;

  // sum z_i e_i by least squares: K fast, K = S_zb (S_bb + noise)^-1.
  const Vector3 unseen = kUnseenSpin * Vector3(sums.euler * up);
  Matrix3 total = swing * sums.moments + noise + unseen * unseen.transpose();
  const Real size = total.trace();
  Matrix3 weight = Matrix3::Zero();
  if (size > 0) {
    total = total / size + kRegular * Matrix3::Identity();
    weight = swing / size * sums.push_moments * total.inverse();
  }
  const Matrix3 direct = sums.mass * Matrix3::Identity() - hat(sums.mass_zeta) * up_hat;
  const Matrix3 cross = direct * (weight * by_f).transpose();
  Force force;
  force.value_B =
      sums.mass * a.specific_force_B + a.angular_B.cross(sums.mass_zeta) + sums.mass_c + weight * fast - now.force_B;
  force.covariance_B = swing * (sums.pushes - weight * sums.push_moments.transpose()) +
                       f_noise * (direct * direct.transpose() - cross - cross.transpose());
  return force;
}

// Variance of an axis of the accelerometer by its constant errors, at a specific force.
Real constant_errors(const TriadErrors& errors, const Vector3& f) {
  return square(errors.bias) + f.squaredNorm() * (square(errors.misalignment_rad) + square(errors.scale_error));
}

// N, f_s and their bands. Tilt turns one into the other.
void publish(const Instant& now, const Force& force, Real constant_n2, Real tilt_square, MeasuredContact& out) {
  const Vector3& up = now.up_B;
  const Real normal = force.value_B.dot(up);
  const Vector3 friction_B = force.value_B - normal * up;
  const Real friction = std::sqrt(friction_B.squaredNorm());
  // Any direction will do where there is no friction.
  Vector3 ahead = friction > 0 ? Vector3(friction_B / friction) : Vector3(up.unitOrthogonal());
  const Vector3 aside = up.cross(ahead);
  const Real tilt_n2 = square(normal) * tilt_square;
  const Real normal_n2 = along(force.covariance_B, up) + constant_n2;
  const Real ahead_n2 = along(force.covariance_B, ahead) + constant_n2 + tilt_n2;
  const Real aside_n2 = along(force.covariance_B, aside) + constant_n2 + tilt_n2;
  const Real together_n2 = up.dot(Vector3(force.covariance_B * ahead));
  out.normal_force_n = normal;
  out.normal_sigma_n = root(normal_n2 + square(friction) * tilt_square);
  out.static_friction_n = friction;
  out.mu_required = out.mu_sigma = std::numeric_limits<Real>::infinity();
  if (!(normal > 0)) return;
  const Real mu = friction / normal;
  // Across the force an error counts as far as it makes the vector longer: fully where there is no friction.
  const Real across_n2 = aside_n2 > 0 ? square(aside_n2) / (square(friction) + aside_n2) : Real(0);
  const Real variance = ahead_n2 + across_n2 - 2 * mu * together_n2 + square(mu) * normal_n2;
  out.mu_required = mu;
  out.mu_sigma = root(variance) / normal;
}

// The speed that the contact point gains by this sample.
void add_slip(const BallParams& ball, const Instant& now, const Vector3& f, const ContactSums& sums, Real dt,
              ContactMeter& meter) {
  const Vector3 acceleration_W = now.to_W * (f + now.gravity_B), rate_W = now.to_W * now.rate_B;
  const Vector2 acceleration(acceleration_W[0], acceleration_W[1]);
  const Vector2 rolling(ball.radius_m * rate_W[1], -ball.radius_m * rate_W[0]);
  // With a slip's acceleration w the moments about the contact point leave -sum m_i s_i x w.
  const Vector3 spin = ball.inertia_kgm2.cwiseProduct(now.rate_B);
  const Vector3 moment = (ball.radius_m * now.up_B).cross(now.force_B) + sums.mass_s.cross(now.gravity_B) -
                         now.rate_B.cross(spin) - sums.moment_c;
  contact::LastSample& last = meter.last;
  if (meter.followed) {
    // A trapezoid leaves out dt / 12 of the second difference.
    const Vector2 gain = acceleration - last.acceleration_W_mps2;
    const Real bent = square(dt / 12) * (gain - last.gain_W_mps2).squaredNorm();
    meter.bent_square_m2ps2 += kBentMemory * (bent - meter.bent_square_m2ps2);
    last.gain_W_mps2 = gain;
    meter.block.by_accelerometer_W_mps +=
        dt / 2 * (acceleration + last.acceleration_W_mps2) - (rolling - last.rolling_velocity_W_mps);
    const Real lever = sums.mass_s.dot(now.up_B);
    if (lever > kLeastLever * sums.mass * ball.radius_m) {
      const Vector3 change = now.rate_B - last.rate_B_radps;
      const Vector3 about_contact =  // A_s = sum m_i (|s_i|^2 - s_i s_i^T) + I, times the change
          sums.euler * change + ball.radius_m * (lever * change - sums.mass_s.dot(change) * now.up_B);
      const Vector3 left = about_contact - dt / 2 * (moment + last.rolling_moment_B_nm);
      const Vector3 gained_W = now.to_W * now.up_B.cross(left) / lever;
      meter.block.by_rotation_W_mps += Vector2(gained_W[0], gained_W[1]);
    }
    ++meter.block_samples;
  } else {
    ++meter.block.gaps;
  }
  last.acceleration_W_mps2 = acceleration;
  last.rolling_velocity_W_mps = rolling;
  last.rolling_moment_B_nm = moment;
  last.rate_B_radps = now.rate_B;
}

// Standard deviations that a window's speed has without slip.
struct SlipNoise {
  Real offset_mps2;   // of the acceleration, constant
  Real drift_mps3;    // its change
  Real rate_m2ps2;    // variance by the gyro at both ends
  Real turned_m2ps2;  // the same of the speed by rotation, and the masses' swing
  Real walk_m2ps3;    // variance per time by the accelerometer and its integration
  Real tilt_part;     // by which tilt acts on the speed by rotation, in its action on that by the accelerometer
};

SlipNoise slip_noise(const BallParams& ball, const EstimationParams& params, Real constant_m2ps4, Real tilt_square,
                     Real sample_s, Real rate_square, Real turned_arm_m, Real tilt_part, Real swing_m2ps2,
                     Real bent_m2ps2) {
  const Real gravity2 = square(ball.gravity_mps2);
  // Errors fixed to the body turn with it, and the gyro's scale and axes tilt the estimate as the ball turns.
  const Real turning =
      constant_m2ps4 + gravity2 * (square(params.gyro.scale_error) + square(params.gyro.misalignment_rad));
  // The swing counts with its greatest value, and not with sigmas: the division undoes slip_threshold()'s factor.
  return {std::sqrt(constant_m2ps4 + gravity2 * tilt_square),
          std::sqrt(rate_square * turning + square(kTiltRate_radps) * gravity2 * tilt_square),
          2 * square((ball.radius_m + std::sqrt(params.accelerometer_position_B_m.squaredNorm())) * params.gyro.noise),
          2 * square(turned_arm_m * params.gyro.noise) + swing_m2ps2 / square(kNoiseSigmas),
          square(params.accelerometer.noise) * sample_s + bent_m2ps2 / sample_s,
          tilt_part};
}

// Gains from one total to a later one.
contact::Slip between(const contact::SlipTotal& from, const contact::SlipTotal& to) {
  const auto difference = [](const std::array<Wide, 2>& a, const std::array<Wide, 2>& b) {
    return Vector2(static_cast<Real>(b[0] - a[0]), static_cast<Real>(b[1] - a[1]));
  };
  return {difference(from.by_accelerometer_W_mps, to.by_accelerometer_W_mps),
          difference(from.by_rotation_W_mps, to.by_rotation_W_mps), to.gaps - from.gaps};
}

// The total `blocks` blocks before the end of the newest one, 1..block_count.
const contact::SlipTotal& total_before(const ContactMeter& meter, int blocks) {
  const int at = meter.next_block - blocks;
  return meter.totals[static_cast<std::size_t>(at < 0 ? at + contact::kBlocks : at)];
}

// The threshold of a window's speed, from its constant error and the variance of its noise.
Real slip_threshold(Real error_mps, Real noise_m2ps2, Real least_mps) {
  const Real threshold = std::sqrt(square(kErrorSigmas * error_mps) + square(kNoiseSigmas) * noise_m2ps2);
  return threshold > least_mps ? threshold : least_mps;
}

// Judges all windows that end with the newest block. True: a window shows slip.
bool slips(const SlipNoise& noise, Real block_s, ContactMeter& meter) {
  bool found = false;
  meter.slip_score = 0;
  for (std::size_t k = 0; k < contact::kWindowEpochs.size(); ++k) {
    const int blocks = contact::kWindowEpochs[k] * contact::kEpochBlocks;
    const contact::BeliefEffect& belief = meter.belief.effects[k];
    if (blocks > meter.block_count || !belief.known) break;
    const int before = meter.block_count - blocks < kBaseline ? meter.block_count - blocks : kBaseline;
    const Real window_s = static_cast<Real>(blocks) * block_s, baseline_s = static_cast<Real>(before) * block_s;
    const contact::SlipTotal& begin = total_before(meter, blocks);
    const contact::Slip window = between(begin, meter.total);
    Vector2 speed = window.by_accelerometer_W_mps, confirmed = window.by_rotation_W_mps;
    Real error = window_s * noise.offset_mps2, part = 0, gaps = static_cast<Real>(window.gaps);
    if (before >= kLeastBaseline) {
      const contact::Slip expected = between(total_before(meter, blocks + before), begin);
      part = static_cast<Real>(blocks) / static_cast<Real>(before);
      speed -= part * expected.by_accelerometer_W_mps;
      confirmed -= part * expected.by_rotation_W_mps;
      gaps += square(part) * static_cast<Real>(expected.gaps);
      const Real drifted = window_s * noise.drift_mps3 * (window_s + baseline_s) / 2;
      error = drifted < Real(1.4142136) * error ? drifted : Real(1.4142136) * error;
    }
    confirmed -= belief.mean_W_mps;
    // Noise of the rates at the end, where window and baseline meet, at the start, and on both sides of gaps.
    const Real ends = (1 + square(1 + part) + square(part)) / 2 + gaps, walk = (1 + part) * noise.walk_m2ps3 * window_s;
    const Real threshold = slip_threshold(error, ends * noise.rate_m2ps2 + walk, kLeastSlip_mps);
    // The band of belief counts with sigmas of its own: the division undoes slip_threshold()'s factor.
    const Real turned_noise = ends * noise.turned_m2ps2 + square(kBeliefSigmas / kNoiseSigmas * belief.sigma_mps);
    const Real turned_threshold = slip_threshold(noise.tilt_part * error, turned_noise, kLeastTurned_mps);
    const Real score = std::sqrt(speed.squaredNorm()) / threshold;
    if (score > meter.slip_score) meter.slip_score = score;
    const Real common = speed.dot(confirmed);
    const Real doubted = kBeliefConfirmed * belief.sigma_mps * std::sqrt(speed.squaredNorm());
    const bool by_accelerometer =
        score > 1 && common > kConfirmed * speed.squaredNorm() + doubted && common > kAgreed * confirmed.squaredNorm();
    // Masses that lag behind their command move the centre of mass, which only the mean before takes off.
    const bool by_rotation = before >= kLeastBaseline && confirmed.squaredNorm() > square(turned_threshold) &&
                             common > kTurnedConfirmed * confirmed.squaredNorm();
    if (by_accelerometer || by_rotation) found = true;
  }
  return found;
}

// Variance of a lesson's speed by rotation with true belief: three rates, and the tilt's drift over two windows.
Real lesson_noise(const SlipNoise& noise, Real block_s) {
  const Real lesson_s = static_cast<Real>(contact::kLessonEpochs * contact::kEpochBlocks) * block_s;
  return square(noise.tilt_part * noise.drift_mps3 * square(lesson_s)) + 3 * noise.turned_m2ps2;
}

// Follows the errors of belief by a block: learns from a window that is past, or finds anew what they do to one of the
// windows of slip.
void follow_belief(const BallParams& ball, const contact::BlockState& state, const SlipNoise& noise,
                   ContactMeter& meter) {
  contact::BeliefMeter& belief = meter.belief;
  add(ball, state, belief);
  const int component = component_to_learn(belief);
  if (component < 0) {
    expect(ball, state, belief);
    return;
  }
  // A slip that is flagged may have begun before: with the lesson's lag it teaches nothing.
  if (!meter.moved || meter.newest.slip_detected) return;
  const auto total = [&](int epochs) -> const contact::SlipTotal& {
    return total_before(meter, belief.epoch_block + contact::kEpochBlocks * epochs);
  };
  constexpr int kLast = contact::kLessonLag, kLength = contact::kLessonEpochs;
  const contact::SlipTotal &before = total(kLast + 2 * kLength), &begin = total(kLast + kLength), &end = total(kLast);
  if (before.gaps != end.gaps) return;
  const auto j = static_cast<std::size_t>(component);
  const Wide from = before.by_rotation_W_mps[j], middle = begin.by_rotation_W_mps[j], to = end.by_rotation_W_mps[j];
  learn(ball, state, j, static_cast<Real>((to - middle) - (middle - from)), lesson_noise(noise, state.block_s), belief);
}

void end_block(const BallParams& ball, const EstimationParams& params, const Instant& now, const ContactSums& sums,
               Real constant_m2ps4, Real tilt_square, Real dt, ContactMeter& meter) {
  const bool sampled = meter.block_samples >= kLeastBlock;
  const Real block_s = static_cast<Real>(meter.block_samples) * dt;
  meter.totals[static_cast<std::size_t>(meter.next_block)] = meter.total;
  for (int j = 0; j < 2; ++j) {
    const auto k = static_cast<std::size_t>(j);
    meter.total.by_accelerometer_W_mps[k] += static_cast<Wide>(meter.block.by_accelerometer_W_mps[j]);
    meter.total.by_rotation_W_mps[k] += static_cast<Wide>(meter.block.by_rotation_W_mps[j]);
  }
  meter.total.gaps += meter.block.gaps;
  meter.next_block = meter.next_block + 1 < contact::kBlocks ? meter.next_block + 1 : 0;
  if (meter.block_count < contact::kBlocks) ++meter.block_count;
  meter.block = {};
  meter.block_samples = 0;
  meter.rate_square_rad2ps2 += kRateMemory * (now.rate_B.squaredNorm() - meter.rate_square_rad2ps2);
  // Weight turns the ball by sum m_i zeta_i, a slip's acceleration by sum m_i s_i.
  const Real lever = sums.mass_s.dot(now.up_B), arm = std::sqrt(sums.mass_zeta.squaredNorm());
  const Real tilt_part = arm < lever ? arm / lever : Real(1);
  // A change of the rate counts as a speed by this arm: that of A_s, over the same lever.
  const Real euler = std::sqrt(sums.euler.squaredNorm());
  const Real turned_arm_m = lever > 0 ? ball.radius_m + euler / lever : ball.radius_m;
  const Real swing_m2ps2 = lever > 0 ? meter.impulse_power_n2m2s2 / square(lever) : Real(0);
  const SlipNoise noise = slip_noise(ball, params, constant_m2ps4, tilt_square, dt, meter.rate_square_rad2ps2,
                                     turned_arm_m, tilt_part, swing_m2ps2, meter.bent_square_m2ps2);
  const bool turns = lever > kLeastLever * sums.mass * ball.radius_m;
  follow_belief(ball,
                {now.to_W, sums.place_B, meter.last.rolling_velocity_W_mps, sums.mass, turns ? lever : Real(0), block_s,
                 meter.imu_tick < 0},
                noise, meter);
  const bool separable = constant_m2ps4 < square(kMostConstant * ball.gravity_mps2);
  meter.newest.slip_detected = slips(noise, block_s, meter) && meter.moved && separable && sampled;
}

void watch_for_light(const BallParams& ball, Real mass, Real dt, ContactMeter& meter) {
  const MeasuredContact& measured = meter.newest;
  const Real at_rest_n = -mass * ball.gravity_mps2 * ball.down_W[2] - ball.external_force_W_n[2];
  const bool light = measured.normal_force_n + kLightSigmas * measured.normal_sigma_n < kLightPart * at_rest_n;
  meter.light_s = light ? meter.light_s + dt : Real(0);
  meter.newest.light_detected = meter.moved && fills_blocks(dt) && meter.light_s > kBlock_s;
}

// Takes over a new sample's time. Returns the ticks since the sample before; 0: it follows none, or too late.
std::int64_t follow(const EstimationParams& params, const Sensors& sensors, ContactMeter& meter) {
  const std::int64_t gap = ticks_between(meter.imu_tick, sensors.imu_tick);
  const bool in_time = meter.followed && gap > 0 && gap <= std::int64_t{kLongestGap} * params.imu_period_ticks;
  meter.imu_count = sensors.imu_count;
  meter.imu_tick = sensors.imu_tick;
  return in_time ? gap : 0;
}

// Whether a sample of this age says anything of the present.
bool recent(const EstimationParams& params, std::int64_t age_ticks) {
  const std::int64_t oldest = params.imu_latency_ticks + std::int64_t{kLongestGap} * params.imu_period_ticks;
  return age_ticks >= 0 && age_ticks <= oldest;
}

bool usable(const EstimationParams& params, const Sensors& sensors, std::int64_t age_ticks, ContactMeter& meter) {
  const bool good_gyro = usable(params.gyro, sensors.gyro_B_radps, meter.gyro);
  const bool good_accelerometer = usable(params.accelerometer, sensors.accelerometer_B_mps2, meter.accelerometer);
  return good_gyro && good_accelerometer && recent(params, age_ticks);
}

// Says that nothing is measured, until the next usable sample.
void withdraw(MeasuredContact& measured) { measured.valid = measured.slip_detected = measured.light_detected = false; }

bool finite(const ContactMeter& meter) {
  const MeasuredContact& m = meter.newest;
  Real sum = m.normal_force_n + m.normal_sigma_n + m.static_friction_n + m.slip_mps2 + meter.moment_power_n2m2 +
             meter.impulse_power_n2m2s2 + meter.bent_square_m2ps2;
  for (int j = 0; j < 3; ++j) sum += meter.rate_B_radps[j] + meter.slow_moment_B_nm[j];
  for (int j = 0; j < 2; ++j) {
    sum += meter.block.by_accelerometer_W_mps[j] + meter.block.by_rotation_W_mps[j];
    const auto k = static_cast<std::size_t>(j);
    sum += static_cast<Real>(meter.total.by_accelerometer_W_mps[k] + meter.total.by_rotation_W_mps[k]);
  }
  return std::isfinite(sum);
}

// Begins anew. The totals are not read before blocks are counted.
void forget(ContactMeter& meter) {
  meter.followed = false;
  meter.last = {};
  meter.rate_B_radps = meter.correction_B_radps2 = meter.slow_moment_B_nm = Vector3::Zero();
  meter.impulse_B_nms = Vector3::Zero();
  meter.moment_power_n2m2 = meter.impulse_power_n2m2s2 = meter.bent_square_m2ps2 = meter.rate_square_rad2ps2 =
      meter.slip_score = meter.light_s = 0;
  meter.block = {};
  meter.total = {};
  meter.block_samples = meter.next_block = meter.block_count = 0;
  reset(meter.belief);
  meter.newest = {};
}

}  // namespace

void reset(const BallParams&, const EstimationParams&, ContactMeter& meter) {
  forget(meter);
  meter.moved = false;
  meter.imu_count = meter.imu_tick = 0;
  meter.gyro = meter.accelerometer = {};
}

void measure_contact(const BallParams& ball, const EstimationParams& params, Wide control_period_s,
                     const Sensors& sensors, const MassMotion& commanded, const MassMotion& masses,
                     const Estimate& estimate, std::int64_t tick, ContactMeter& meter, MeasuredContact& out) {
  const bool stood = !meter.moved;
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    meter.moved = meter.moved || commanded.velocity[k] != 0 || commanded.acceleration[k] != 0;
  }
  if (sensors.imu_count == meter.imu_count) {
    if (!recent(params, ticks_between(meter.imu_tick, tick))) withdraw(meter.newest);
    out = meter.newest;
    return;
  }
  const bool held = meter.imu_tick < 0;
  const std::int64_t gap_ticks = follow(params, sensors, meter);
  const std::int64_t age_ticks = ticks_between(sensors.imu_tick, tick);
  // A ball that was held until tick 0, or until the masses move, may jump to its rolling rate then.
  const bool released = (held && sensors.imu_tick >= 0) || (stood && meter.moved);
  meter.followed = gap_ticks > 0 && !released;
  if (!usable(params, sensors, age_ticks, meter) || !estimate.valid) {
    meter.followed = false;
    withdraw(meter.newest);
    out = meter.newest;
    return;
  }

  const auto period_s = static_cast<Real>(control_period_s);
  const Real dt = period_s * static_cast<Real>(meter.followed ? gap_ticks : params.imu_period_ticks);
  const Real age_s = period_s * static_cast<Real>(age_ticks);
  const Real tilt_square = square(estimate.tilt_sigma_rad);
  const Instant now(ball, params, sensors, estimate, age_s);
  const ContactSums sums = sums_of(ball, now, masses, age_s);
  const Acceleration a = observe(ball, params, now, dt, meter);
  const Force force = force_of(ball, params, now, a, sums, dt, meter);
  const Real constant_m2ps4 = constant_errors(params.accelerometer, a.specific_force_B);
  MeasuredContact& measured = meter.newest;
  measured.valid = true;
  publish(now, force, square(sums.mass) * constant_m2ps4, tilt_square, measured);
  const Vector3 slip_B = ball.radius_m * now.up_B.cross(meter.correction_B_radps2);
  measured.slip_mps2 = std::sqrt(slip_B.squaredNorm());
  measured.slip_sigma_mps2 = std::sqrt(constant_m2ps4 + square(ball.gravity_mps2) * tilt_square);
  add_slip(ball, now, a.specific_force_B, sums, dt, meter);
  if (meter.block_samples > 0 && static_cast<Real>(meter.block_samples) * dt > kBlock_s - dt / 2) {
    end_block(ball, params, now, sums, constant_m2ps4, tilt_square, dt, meter);
  }
  watch_for_light(ball, sums.mass, dt, meter);
  meter.followed = true;
  if (!finite(meter)) forget(meter);
  out = measured;
}

}  // namespace ballast::firmware
