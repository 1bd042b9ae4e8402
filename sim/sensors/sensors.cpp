#include "sim/sensors/sensors.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sim/motors/random.h"

namespace ballast::sim {

namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

// Decimal rates and periods make whole numbers of ticks up to rounding.
constexpr double kRounding = 1e-9;

// No run has as many: a second sample never comes.
constexpr double kMostTicks = 1e15;

enum class Stream : std::uint64_t { kGyro = 1, kAccelerometer, kFix };

std::uint64_t seed_of(std::uint64_t seed, Stream stream) {
  std::uint64_t state = seed ^ (0xA24BAED4963EE407u * static_cast<std::uint64_t>(stream));
  return random_bits(state);
}

Vector3d three(double sigma, std::uint64_t& random) {
  Vector3d drawn;
  for (int j = 0; j < 3; ++j) drawn[j] = sigma * normal(random);
  return drawn;
}

double rounded(double value, double resolution) {
  return resolution > 0 ? resolution * std::nearbyint(value / resolution) : value;
}

bool takes_sample(std::int64_t tick, std::int64_t every_ticks) { return every_ticks > 0 && tick % every_ticks == 0; }

// Moves what is due by this tick out of the queue, and keeps the newest.
template <class Queue, class Reading>
void deliver(Queue& on_its_way, std::int64_t tick, Reading& newest) {
  while (!on_its_way.empty() && on_its_way.front().due_tick <= tick) {
    newest = on_its_way.front().reading;
    on_its_way.pop_front();
  }
}

}  // namespace

std::int64_t delay_ticks(double delay_s, double control_period_s) {
  return static_cast<std::int64_t>(std::ceil(delay_s / control_period_s - kRounding));
}

std::int64_t ticks_per_sample(double rate_hz, double control_period_s) {
  const double ticks = 1 / (rate_hz * control_period_s), whole = std::nearbyint(ticks);
  if (!(whole >= 1 && std::abs(ticks - whole) <= kRounding * whole)) return 0;
  return static_cast<std::int64_t>(std::min(whole, kMostTicks));
}

Triad::Triad(const ImuTriad& model, double rate_hz, std::uint64_t seed)
    : model_(model),
      noise_(model.noise_density * std::sqrt(rate_hz / 2)),
      walk_(model.bias_walk / std::sqrt(rate_hz)),
      random_(seed) {
  const Vector3d turn_rad = three(model.misalignment_rad, random_);
  const double angle = turn_rad.norm();
  Eigen::Matrix3d turned = Eigen::Matrix3d::Identity();
  if (angle > 0) turned = Eigen::AngleAxisd(angle, Vector3d(turn_rad / angle)).toRotationMatrix();
  const Vector3d scale = Vector3d::Ones() + three(model.scale_error, random_);
  axes_ = scale.asDiagonal() * turned;
  bias_ = three(model.bias, random_);
}

Vector3d Triad::read(const Vector3d& truth) {
  Vector3d reading = axes_ * truth + bias_ + three(noise_, random_);
  for (int j = 0; j < 3; ++j) {
    if (model_.range > 0) reading[j] = std::clamp(reading[j], -model_.range, model_.range);
    reading[j] = rounded(reading[j], model_.resolution);
  }
  bias_ += three(walk_, random_);
  return reading;
}

Sensors::Sensors(const SensorModel& model, double control_period_s, std::uint64_t seed)
    : model_(model),
      imu_every_ticks_(ticks_per_sample(model.rate_hz, control_period_s)),
      fix_every_ticks_(model.fix.rate_hz > 0 ? ticks_per_sample(model.fix.rate_hz, control_period_s) : 0),
      imu_latency_ticks_(delay_ticks(model.latency_s, control_period_s)),
      fix_delay_ticks_(delay_ticks(model.fix.delay_s, control_period_s)),
      gyro_(model.gyro, model.rate_hz, seed_of(seed, Stream::kGyro)),
      accelerometer_(model.accelerometer, model.rate_hz, seed_of(seed, Stream::kAccelerometer)),
      fix_random_(seed_of(seed, Stream::kFix)) {}

const SensorReadings& Sensors::read(std::int64_t tick, const TrueMotion& truth) {
  if (takes_sample(tick, imu_every_ticks_)) {
    const Vector3d& omega = truth.angular_velocity_B_radps;
    const Vector3d& d = model_.accelerometer_position_B_m;
    const Vector3d specific_force_B =
        truth.specific_force_B_mps2 + truth.angular_acceleration_B_radps2.cross(d) + omega.cross(omega.cross(d));
    ImuReading imu{gyro_.read(omega), accelerometer_.read(specific_force_B), tick, ++imu_count_};
    imu_.push_back({imu, tick + imu_latency_ticks_});
  }
  if (takes_sample(tick, fix_every_ticks_)) {
    Vector2d seen_W_m = truth.position_W_m;
    for (int j = 0; j < 2; ++j) seen_W_m[j] += model_.fix.noise_m * normal(fix_random_);
    fixes_.push_back({{seen_W_m, tick, ++fix_count_}, tick + fix_delay_ticks_});
  }
  deliver(imu_, tick, readings_.imu);
  deliver(fixes_, tick, readings_.fix);
  for (std::size_t i = 0; i < model_.encoder_resolution.size(); ++i) {
    readings_.encoder[i] = rounded(truth.mass_position[i], model_.encoder_resolution[i]);
  }
  return readings_;
}

}  // namespace ballast::sim
