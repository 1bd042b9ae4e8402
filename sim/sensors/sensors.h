// Readings of the robot's sensors for a true motion: IMU, encoders, and a place from outside.
//
// One reading is
//   truth -> misalignment -> scale -> bias -> noise -> saturation -> rounding,
// with a sample's noise of standard deviation noise_density sqrt(rate / 2), the density being one-sided. The
// accelerometer stands off the geometric centre by d and measures the specific force there,
//   f = a_GC - g + Omegadot x d + Omega x (Omega x d).
//
// Source: our derivation. Everything random comes from the seed, each sensor and component with a stream of its own, so
// that one sensor's settings do not change another's noise.
#pragma once

#include <array>
#include <cstdint>
#include <deque>

#include "sim/masses/mass.h"
#include "sim/sensors/sensor_model.h"

namespace ballast::sim {

// The true motion in a control tick, body frame.
struct TrueMotion {
  Eigen::Vector3d angular_velocity_B_radps;
  Eigen::Vector3d angular_acceleration_B_radps2;
  Eigen::Vector3d specific_force_B_mps2;  // a_GC - g
  Eigen::Vector2d position_W_m;           // of the geometric centre
  std::array<double, kMaxMasses> mass_position{};
};

struct ImuReading {
  Eigen::Vector3d gyro_B_radps = Eigen::Vector3d::Zero();
  Eigen::Vector3d accelerometer_B_mps2 = Eigen::Vector3d::Zero();
  std::int64_t tick = 0;   // of the sample
  std::int64_t count = 0;  // samples so far, this one included; 0: none yet
};

struct FixReading {
  Eigen::Vector2d position_W_m = Eigen::Vector2d::Zero();
  std::int64_t tick = 0;
  std::int64_t count = 0;
};

// As they have arrived by a tick: the newest of each.
struct SensorReadings {
  ImuReading imu;
  FixReading fix;
  std::array<double, kMaxMasses> encoder{};  // rail coordinates; 0 where there is none
};

// One triad with its errors of this run.
class Triad {
 public:
  Triad(const ImuTriad& model, double rate_hz, std::uint64_t seed);
  // One sample, and the walk of the bias up to the next.
  Eigen::Vector3d read(const Eigen::Vector3d& truth);
  [[nodiscard]] const Eigen::Vector3d& bias() const { return bias_; }

 private:
  ImuTriad model_;
  double noise_, walk_;  // standard deviations, of a sample and from one sample to the next
  std::uint64_t random_;
  Eigen::Matrix3d axes_;  // misaligned and scaled
  Eigen::Vector3d bias_;
};

class Sensors {
 public:
  // The rates divide the tick rate (the reader of a scenario checks it).
  Sensors(const SensorModel& model, double control_period_s, std::uint64_t seed);

  // Once per tick, in order.
  const SensorReadings& read(std::int64_t tick, const TrueMotion& truth);

  // The offset that the gyro now adds to every true reading.
  [[nodiscard]] const Eigen::Vector3d& gyro_bias_B_radps() const { return gyro_.bias(); }

 private:
  template <class Reading>
  struct OnItsWay {
    Reading reading;
    std::int64_t due_tick;
  };

  SensorModel model_;
  std::int64_t imu_every_ticks_, fix_every_ticks_;  // fix: 0 for none
  std::int64_t imu_latency_ticks_, fix_delay_ticks_;
  Triad gyro_, accelerometer_;
  std::uint64_t fix_random_;
  std::int64_t imu_count_ = 0, fix_count_ = 0;  // samples taken
  std::deque<OnItsWay<ImuReading>> imu_;
  std::deque<OnItsWay<FixReading>> fixes_;
  SensorReadings readings_;
};

// Control ticks after which what is delayed has come: in the first tick at or after the delay.
[[nodiscard]] std::int64_t delay_ticks(double delay_s, double control_period_s);

// Control ticks from one sample to the next, if the rate divides the tick rate; 0 otherwise.
[[nodiscard]] std::int64_t ticks_per_sample(double rate_hz, double control_period_s);

}  // namespace ballast::sim
