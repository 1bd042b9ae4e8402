#include "firmware/estimation/belief_errors.h"

#include <cmath>

namespace ballast::firmware::contact {

namespace {

// 1 sigma of the prior: of each mass and of the inertia as parts, about that of errors uniform within 5 %; of the
// centre of mass along each axis as a part of the radius, uniform within 0.5 %; of the rolling resistance.
constexpr auto kMassError = static_cast<Real>(0.03), kCenterError = static_cast<Real>(0.003),
               kResistanceError = static_cast<Real>(0.001);
constexpr auto kCreep_mps = static_cast<Real>(0.01);  // below it a ball has no clear direction

// Lessons overlap, 16 of them in the time of one, and their errors with them: the noise counts with a multiple of its
// variance, found on desk_ball. A lesson that its band does not explain at so many sigma is left out.
constexpr auto kOverlap = static_cast<Real>(4), kSurprise = static_cast<Real>(4);
constexpr auto kLeastNoise_mps = static_cast<Real>(0.001);
// Variance that each error gains with a lesson, for what the sensitivities leave out: 1 sigma in 250 s.
constexpr auto kForgotten = static_cast<Real>(2e-4);
// 1 sigma of an expected effect, in parts of it: sensitivities are good to a few per cent, and up to 0.15 s old.
constexpr auto kEffectError = static_cast<Real>(0.15);
constexpr Real kGreatest = 0x1p50;  // as everywhere in the firmware

Real square(Real x) { return x * x; }

std::size_t error_count(const BallParams& ball) { return static_cast<std::size_t>(ball.mass_count) + 5; }

const BeliefSums& start_before(const BeliefMeter& meter, int epochs) {
  const int at = meter.next_epoch - 1 - epochs;
  return meter.starts[static_cast<std::size_t>(at < 0 ? at + kEpochs : at)];
}

// A window, and its baseline before it.
struct Window {
  Window(const BeliefMeter& meter, int last, int epochs, int baseline)
      : before(start_before(meter, last + epochs + baseline)),
        begin(start_before(meter, last + epochs)),
        end(start_before(meter, last)),
        part(baseline > 0 ? static_cast<Real>(epochs) / static_cast<Real>(baseline) : Real(0)) {}

  // One of the sums over the window, beyond the window's part of the baseline.
  [[nodiscard]] Real of(Real at_before, Real at_begin, Real at_end) const {
    return at_end - at_begin - part * (at_begin - at_before);
  }

  const BeliefSums &before, &begin, &end;
  Real part;
};

// By how much component j of a window's speed by rotation grows with each error.
void sensitivities(const BallParams& ball, const BlockState& state, const Window& window, std::size_t j,
                   ErrorVector& out) {
  const Real g = ball.gravity_mps2, r = ball.radius_m;
  const BeliefSums &before = window.before, &begin = window.begin, &end = window.end;
  const Vector3 up_B = state.to_W.row(2).transpose();
  const Real gained = window.of(before.velocity_W_mps[j], begin.velocity_W_mps[j], end.velocity_W_mps[j]);
  const Real mass_part = kMassError / state.lever_kgm;
  std::size_t k = 0;
  for (; k < static_cast<std::size_t>(ball.mass_count); ++k) {
    const Real offset = window.of(before.offset_W_ms[k][j], begin.offset_W_ms[k][j], end.offset_W_ms[k][j]);
    out[k] = mass_part * ball.mass_kg[k] * ((r + state.place_B[k].dot(up_B)) * gained - g * offset);
  }
  const Real inertia = (ball.inertia_kgm2[0] + ball.inertia_kgm2[1] + ball.inertia_kgm2[2]) / (3 * r);
  out[k++] = mass_part * std::sqrt(square(ball.shell_mass_kg * r) + square(inertia)) * gained;
  const Real center_part = kCenterError * ball.shell_mass_kg * g * r / state.lever_kgm;
  for (std::size_t i = 3 * j; i < 3 * j + 3; ++i) {
    out[k++] = center_part * window.of(before.axes_s[i], begin.axes_s[i], end.axes_s[i]);
  }
  // The moments of the speed by rotation have no resistance, believed or not.
  out[k] = (kResistanceError + ball.rolling_resistance) * state.mass_kg * g * r / state.lever_kgm *
           window.of(before.heading_s[j], begin.heading_s[j], end.heading_s[j]);
}

// Returns h^T P h, and sets P h.
Real spread(const BeliefMeter& meter, const ErrorVector& h, std::size_t count, ErrorVector& weighed) {
  Real sum = 0;
  for (std::size_t i = 0; i < count; ++i) {
    Real row = 0;
    for (std::size_t k = 0; k < count; ++k) row += meter.covariance[i][k] * h[k];
    weighed[i] = row;
    sum += h[i] * row;
  }
  return sum;
}

Real product(const ErrorVector& a, const ErrorVector& b, std::size_t count) {
  Real sum = 0;
  for (std::size_t i = 0; i < count; ++i) sum += a[i] * b[i];
  return sum;
}

}  // namespace

void reset(BeliefMeter& meter) {
  meter.sums = {};
  meter.epoch_block = meter.next_epoch = meter.epoch_count = meter.next_window = 0;
  meter.mean = {};
  meter.covariance = {};
  for (std::size_t i = 0; i < meter.covariance.size(); ++i) meter.covariance[i][i] = 1;
  meter.effects = {};
}

void add(const BallParams& ball, const BlockState& state, BeliefMeter& meter) {
  if (meter.epoch_block == 0 || meter.epoch_block == kEpochBlocks) {
    meter.starts[static_cast<std::size_t>(meter.next_epoch)] = meter.sums;
    meter.next_epoch = meter.next_epoch + 1 < kEpochs ? meter.next_epoch + 1 : 0;
    if (meter.epoch_count < kEpochs) ++meter.epoch_count;
    meter.epoch_block = 0;
  }
  ++meter.epoch_block;
  if (state.held) return;
  BeliefSums& sums = meter.sums;
  const Real speed = std::sqrt(state.velocity_W_mps.squaredNorm() + square(kCreep_mps));
  for (int j = 0; j < 2; ++j) {
    const auto row = static_cast<std::size_t>(j);
    const Vector3 axis_B = state.to_W.row(j).transpose();
    for (std::size_t k = 0; k < static_cast<std::size_t>(ball.mass_count); ++k) {
      sums.offset_W_ms[k][row] += state.block_s * axis_B.dot(state.place_B[k]);
    }
    for (int i = 0; i < 3; ++i) sums.axes_s[3 * row + static_cast<std::size_t>(i)] += state.block_s * axis_B[i];
    sums.heading_s[row] += state.block_s * state.velocity_W_mps[j] / speed;
    sums.velocity_W_mps[row] = state.velocity_W_mps[j];
  }
}

void expect(const BallParams& ball, const BlockState& state, BeliefMeter& meter) {
  const auto at = static_cast<std::size_t>(meter.next_window);
  meter.next_window = at + 1 < kWindowEpochs.size() ? meter.next_window + 1 : 0;
  const int epochs = kWindowEpochs[at], older = meter.epoch_count - 1 - epochs;
  if (older < 0 || !(state.lever_kgm > 0)) return;
  const int baseline = older < kLeastBaselineEpochs ? 0 : older < kBaselineEpochs ? older : kBaselineEpochs;
  const Window window(meter, 0, epochs, baseline);
  const std::size_t count = error_count(ball);
  BeliefEffect& effect = meter.effects[at];
  Real variance = 0;
  for (std::size_t j = 0; j < 2; ++j) {
    ErrorVector h, weighed;
    sensitivities(ball, state, window, j, h);
    variance += spread(meter, h, count, weighed);
    const Real mean = product(meter.mean, h, count);
    effect.mean_W_mps[static_cast<int>(j)] = mean;
    variance += square(kEffectError * mean);
  }
  effect.sigma_mps = variance > 0 ? std::sqrt(variance) : Real(0);
  effect.known = true;
}

int component_to_learn(const BeliefMeter& meter) {
  if (meter.epoch_count <= kLessonLag + 2 * kLessonEpochs) return -1;
  return meter.epoch_block == 2 ? 0 : meter.epoch_block == 4 ? 1 : -1;
}

void learn(const BallParams& ball, const BlockState& state, std::size_t j, Real speed_mps, Real noise_m2ps2,
           BeliefMeter& meter) {
  if (!(state.lever_kgm > 0)) return;
  const std::size_t count = error_count(ball);
  ErrorVector h, weighed;
  sensitivities(ball, state, Window(meter, kLessonLag, kLessonEpochs, kLessonEpochs), j, h);
  const Real variance = spread(meter, h, count, weighed), noise = noise_m2ps2 + square(kLeastNoise_mps);
  const Real left = speed_mps - product(meter.mean, h, count);
  const Real total = variance + kOverlap * noise;
  if (!(square(left) <= square(kSurprise) * (variance + noise)) || !(total < kGreatest)) return;
  for (std::size_t i = 0; i < count; ++i) {
    const Real gain = weighed[i] / total;
    meter.mean[i] += gain * left;
    for (std::size_t k = 0; k < count; ++k) meter.covariance[i][k] -= gain * weighed[k];
    meter.covariance[i][i] += kForgotten;
  }
}

}  // namespace ballast::firmware::contact
