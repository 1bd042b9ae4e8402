// Sensors against what was asked of them: statistics from many samples, and exact values where nothing is random. If
// BALLAST_ALLAN_OUT names a file, the Allan deviations are written there for tools/plots/allan_deviation.py.
#include "sim/sensors/sensors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <vector>

#include "sim/sensors/imu_presets.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Normal numbers n with mean 0: their root mean square is within 1 +- 2.58 / sqrt(2 n) of sigma in 99 % of all cases.
// The seed is fixed, so that a chance of 1 % decides once.
void expect_sigma(double sigma, double sum_of_squares, double n) {
  EXPECT_NEAR(std::sqrt(sum_of_squares / n) / sigma, 1, 2.58 / std::sqrt(2 * n));
}

TEST(Triad, HasTheNoiseOfItsDensity) {
  const ImuTriad model{.noise_density = 2.4e-4};
  for (const double rate_hz : {200.0, 1000.0}) {
    Triad triad(model, rate_hz, test::random_seed(1));
    Vector3d sum = Vector3d::Zero(), squares = Vector3d::Zero();
    constexpr int kSamples = 1000000;
    Vector3d before = Vector3d::Zero();
    double neighbours = 0;
    for (int k = 0; k < kSamples; ++k) {
      const Vector3d noise = triad.read(Vector3d(1, -2, 3)) - Vector3d(1, -2, 3);
      sum += noise;
      squares += noise.cwiseAbs2();
      neighbours += noise.dot(before);
      before = noise;
    }
    const double sigma = 2.4e-4 * std::sqrt(rate_hz / 2);
    for (int j = 0; j < 3; ++j) {
      expect_sigma(sigma, squares[j], kSamples);
      EXPECT_LT(std::abs(sum[j]), 2.58 * sigma * std::sqrt(kSamples));
    }
    EXPECT_LT(std::abs(neighbours), 2.58 * sigma * sigma * std::sqrt(3 * kSamples)) << "white: neighbours do not agree";
  }
}

// Over many runs: offset, scales and axes have the standard deviations that were asked for.
TEST(Triad, DrawsItsErrorsOncePerRun) {
  const ImuTriad model{.bias = 0.01, .scale_error = 0.005, .misalignment_rad = 0.002};
  const std::uint64_t seed = test::random_seed(2);
  constexpr int kRuns = 30000;
  Vector3d bias = Vector3d::Zero();
  double scale = 0, across = 0;
  for (int run = 0; run < kRuns; ++run) {
    Triad triad(model, 1000, seed + static_cast<std::uint64_t>(run));
    const Vector3d offset = triad.read(Vector3d::Zero());
    EXPECT_EQ(triad.read(Vector3d::Zero()), offset) << "it neither walks nor is noisy";
    bias += offset.cwiseAbs2();
    Matrix3d axes;
    for (int j = 0; j < 3; ++j) axes.col(j) = triad.read(Vector3d::Unit(j)) - offset;
    for (int j = 0; j < 3; ++j) {
      scale += (axes(j, j) - 1) * (axes(j, j) - 1);
      across += axes(j, (j + 1) % 3) * axes(j, (j + 1) % 3);
    }
  }
  for (int j = 0; j < 3; ++j) expect_sigma(0.01, bias[j], kRuns);
  // A turn by 0.002 changes the diagonal by 4e-6, far below the band.
  expect_sigma(0.005, scale, 3 * kRuns);
  expect_sigma(0.002, across, 3 * kRuns);
}

TEST(Triad, ItsBiasWalks) {
  const ImuTriad model{.bias_walk = 1e-3};
  const std::uint64_t seed = test::random_seed(3);
  constexpr int kRuns = 20000;
  double squares = 0;
  for (int run = 0; run < kRuns; ++run) {
    Triad triad(model, 100, seed + static_cast<std::uint64_t>(run));
    for (int k = 0; k < 25; ++k) triad.read(Vector3d::Zero());
    squares += triad.bias().squaredNorm();
  }
  expect_sigma(1e-3 * std::sqrt(0.25), squares, 3 * kRuns);
}

// Allan variances of three axes together, from neighbouring means of m samples that do not overlap.
double allan_variance(const std::vector<Vector3d>& sums, std::size_t m) {
  const std::size_t means = (sums.size() - 1) / m;
  double squares = 0;
  for (std::size_t k = 0; k + 2 <= means; ++k) {
    squares += (sums[(k + 2) * m] - 2 * sums[(k + 1) * m] + sums[k * m]).squaredNorm();
  }
  return squares / (6 * static_cast<double>((means - 1) * m * m));
}

// At rest, white noise of the one-sided density n gives the Allan variance n^2 / (2 tau), and a bias that walks by K
// gives K^2 tau / 3 (IEEE Std 952, annex C). For m samples of a walk that steps with each of them it is
// K^2 dt (2 m^2 + 1) / (6 m) exactly.
TEST(Triad, ItsAllanDeviationLiesOnTheLinesOfNoiseAndWalk) {
  constexpr double kRate_hz = 100;
  constexpr std::size_t kSamples = 1000000;
  std::uint64_t seed = test::random_seed(4);
  const char* out = std::getenv("BALLAST_ALLAN_OUT");
  std::ofstream csv;
  if (out != nullptr) csv.open(out);
  for (const ImuPreset& preset : imu_presets()) {
    if (preset.name.ends_with("_calibrated")) continue;  // has the part's noise and walk
    for (const bool of_gyro : {true, false}) {
      const ImuTriad& part = of_gyro ? preset.gyro : preset.accelerometer;
      const ImuTriad model{.noise_density = part.noise_density, .bias_walk = part.bias_walk};
      Triad triad(model, kRate_hz, ++seed);
      std::vector<Vector3d> sums(kSamples + 1, Vector3d::Zero());
      for (std::size_t k = 0; k < kSamples; ++k) sums[k + 1] = sums[k] + triad.read(Vector3d::Zero());
      for (std::size_t m = 1; m <= kSamples / 50; m *= 2) {
        const double tau_s = static_cast<double>(m) / kRate_hz, count = static_cast<double>(m);
        const double noise = model.noise_density * model.noise_density / (2 * tau_s);
        const double walk = model.bias_walk * model.bias_walk / kRate_hz * (2 * count * count + 1) / (6 * count);
        const std::size_t whole = kSamples / m;
        const double found = allan_variance(sums, m), means = static_cast<double>(whole) - 1;
        // Neighbouring differences correlate by -1/2 (noise) to 1/4 (walk), so that the variance of an axis's estimate
        // is at most 2 (1 + 2/4) / means. 3.8 sigma for each of 70 estimates make a band of 99 % for all of them.
        if (means > 500) {
          EXPECT_NEAR(found / (noise + walk), 1, 3.8 * std::sqrt(1 / means)) << preset.name << " tau " << tau_s;
        }
        csv << preset.name << (of_gyro ? ",gyro," : ",accelerometer,") << tau_s << ',' << std::sqrt(found) << ','
            << model.noise_density << ',' << model.bias_walk << '\n';
      }
    }
  }
}

TEST(Triad, SaturatesAndRounds) {
  Triad triad({.range = 2, .resolution = 0.25}, 1000, 1);
  EXPECT_EQ(triad.read(Vector3d(0.3, -5, 1.9)), Vector3d(0.25, -2, 2));
  EXPECT_EQ(triad.read(Vector3d(0.126, 0.124, 7)), Vector3d(0.25, 0, 2));
}

TrueMotion still() { return {Vector3d::Zero(), Vector3d::Zero(), Vector3d(0, 0, 9.81), Vector2d::Zero(), {}}; }

SensorModel model_at(double rate_hz) {
  SensorModel model;
  model.present = true;
  model.rate_hz = rate_hz;
  return model;
}

TEST(Sensors, WithoutErrorsSayTheTruth) {
  Sensors sensors(model_at(1000), 0.001, 5);
  TrueMotion truth = still();
  truth.angular_velocity_B_radps = Vector3d(0.1, 0.2, 0.3);
  const SensorReadings& now = sensors.read(0, truth);
  EXPECT_EQ(now.imu.gyro_B_radps, truth.angular_velocity_B_radps);
  EXPECT_EQ(now.imu.accelerometer_B_mps2, truth.specific_force_B_mps2);
  EXPECT_EQ(now.fix.count, 0);
}

// Off the centre it is on a circle: Omega^2 d towards the axis, Omegadot d along it.
TEST(Sensors, AnAccelerometerFeelsItsPlace) {
  SensorModel model = model_at(1000);
  model.accelerometer_position_B_m = Vector3d(0.03, 0, 0);
  Sensors sensors(model, 0.001, 5);
  TrueMotion truth = still();
  truth.angular_velocity_B_radps = Vector3d(0, 0, 4);
  truth.angular_acceleration_B_radps2 = Vector3d(0, 0, -10);
  const Vector3d read = sensors.read(0, truth).imu.accelerometer_B_mps2;
  EXPECT_LT((read - Vector3d(-16 * 0.03, -10 * 0.03, 9.81)).norm(), 1e-15);
}

// A sample every fourth tick, which arrives three ticks later.
TEST(Sensors, SampleAtTheirRateAndAreLate) {
  SensorModel model = model_at(250);
  model.latency_s = 0.003;
  Sensors sensors(model, 0.001, 5);
  TrueMotion truth = still();
  for (std::int64_t tick = -2; tick < 40; ++tick) {
    truth.angular_velocity_B_radps[0] = static_cast<double>(tick);
    const ImuReading now = sensors.read(tick, truth).imu;
    const std::int64_t newest = tick < 3 ? -1 : (tick - 3) / 4 * 4;
    EXPECT_EQ(now.count, newest < 0 ? 0 : newest / 4 + 1) << tick;
    if (newest < 0) continue;
    EXPECT_EQ(now.tick, newest);
    EXPECT_EQ(now.gyro_B_radps[0], static_cast<double>(newest));
  }
}

TEST(Sensors, AFixIsNoisyAndLate) {
  SensorModel model = model_at(1000);
  model.fix = {.rate_hz = 100, .noise_m = 0.005, .delay_s = 0.0255};
  Sensors sensors(model, 0.001, test::random_seed(6));
  TrueMotion truth = still();
  double squares = 0;
  int fixes = 0;
  std::int64_t count = 0;
  for (std::int64_t tick = 0; tick < 200000; ++tick) {
    truth.position_W_m = Vector2d(1e-3, -2e-3) * static_cast<double>(tick);
    const FixReading now = sensors.read(tick, truth).fix;
    if (now.count == count) continue;
    EXPECT_EQ(now.count, ++count);
    EXPECT_EQ(tick - now.tick, 26) << "the first tick after the delay";
    EXPECT_EQ(now.tick % 10, 0);
    squares += (now.position_W_m - Vector2d(1e-3, -2e-3) * static_cast<double>(now.tick)).squaredNorm();
    fixes += 2;
  }
  expect_sigma(0.005, squares, fixes);
}

TEST(Sensors, EncodersCountInTheirResolution) {
  SensorModel model = model_at(1000);
  model.encoder_resolution = {0.01, 0};
  Sensors sensors(model, 0.001, 5);
  TrueMotion truth = still();
  truth.mass_position = {0.1234, 0.1234, 0.1234};
  const auto encoder = sensors.read(0, truth).encoder;
  EXPECT_NEAR(encoder[0], 0.12, 1e-15);
  EXPECT_EQ(encoder[1], 0.1234);
  EXPECT_EQ(encoder[2], 0) << "it has none";
}

// The settings of one sensor do not change the others' random numbers; another seed changes all.
TEST(Sensors, HaveRandomNumbersOfTheirOwn) {
  SensorModel model = model_at(1000), other = model;
  model.gyro.noise_density = model.accelerometer.noise_density = 1e-3;
  other.accelerometer.noise_density = 1e-3;
  Sensors one(model, 0.001, 7), two(other, 0.001, 7), three(model, 0.001, 8);
  for (std::int64_t tick = 0; tick < 10; ++tick) {
    const ImuReading a = one.read(tick, still()).imu, b = two.read(tick, still()).imu,
                     c = three.read(tick, still()).imu;
    EXPECT_EQ(a.accelerometer_B_mps2, b.accelerometer_B_mps2);
    EXPECT_NE(a.gyro_B_radps, b.gyro_B_radps);
    EXPECT_NE(a.accelerometer_B_mps2, c.accelerometer_B_mps2);
    EXPECT_NE(a.gyro_B_radps, c.gyro_B_radps);
    EXPECT_NE(a.gyro_B_radps, a.accelerometer_B_mps2 - Vector3d(0, 0, 9.81)) << "one stream for both";
  }
}

TEST(ImuPresets, AreOrdinaryParts) {
  EXPECT_GE(imu_presets().size(), 6u);
  for (const ImuPreset& preset : imu_presets()) {
    SCOPED_TRACE(preset.name);
    EXPECT_FALSE(preset.source.empty());
    EXPECT_GT(preset.gyro.range, 30);  // 2000 degrees/s are 34.9
    EXPECT_GT(preset.accelerometer.range, 3 * 9.81);
    EXPECT_LT(preset.gyro.noise_density, 1e-3);
    EXPECT_LT(preset.accelerometer.bias, 0.3);
    EXPECT_GT(preset.gyro.resolution, 0);
    EXPECT_LT(preset.gyro.resolution, 1e-4 * preset.gyro.range);
    EXPECT_LT(preset.accelerometer.resolution, 1e-4 * preset.accelerometer.range);
  }
}

}  // namespace
}  // namespace ballast::sim
