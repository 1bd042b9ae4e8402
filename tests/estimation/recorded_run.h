// A run's truth, kept tick by tick, and sensors that read it again and again with other seeds. A run with steppers
// costs seconds, a pass of sensors and filter over it a hundredth of that, so that many seeds are affordable.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "firmware/control/params.h"
#include "firmware/estimation/attitude_filter.h"
#include "sim/scenario/scenario.h"
#include "sim/sensors/sensors.h"

namespace ballast::test {

struct TrueTick {
  std::int64_t tick = 0;
  sim::TrueMotion motion;
  Eigen::Quaterniond orientation;
  firmware::MassMotion commanded;
};

struct RecordedRun {
  sim::Scenario scenario;
  std::unique_ptr<firmware::ControllerParams> params;
  std::vector<TrueTick> ticks;
  double path_m = 0;  // length
};

// Runs the scenario in this process, with a hold. Overrides as in --set.
RecordedRun record(const std::string& name, std::vector<std::string> overrides);

// The parameters of the filter for such sensors.
firmware::EstimationParams estimation_params(const sim::Scenario& scenario, const sim::SensorModel& model);

// IMU and fixes of one seed, as the plant's sensors are (sim/sensors/sensors.h), with biases that can be read.
class Imu {
 public:
  Imu(const sim::SensorModel& model, double control_period_s, std::uint64_t seed);
  void read(const TrueTick& truth, firmware::Sensors& sensors);
  // True bias at the newest sample.
  [[nodiscard]] const Eigen::Vector3d& gyro_bias() const { return gyro_bias_; }

 private:
  sim::SensorModel model_;
  double control_period_s_;
  std::int64_t every_, fix_every_;
  sim::Triad gyro_, accelerometer_;
  std::uint64_t fix_random_;
  Eigen::Vector3d gyro_bias_;
  std::vector<firmware::Sensors> on_its_way_, fixes_on_their_way_;
  std::int64_t imu_count_ = 0, fix_count_ = 0;
};

}  // namespace ballast::test
