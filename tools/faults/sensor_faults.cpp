#include "tools/faults/sensor_faults.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

#include "sim/motors/random.h"

namespace ballast::sil {
namespace {

using sim::FaultKind;
using sim::FaultSensor;

// The three components of a rate or an acceleration.
double* axes(FaultSensor sensor, sensors_t& sensors) {
  return sensor == FaultSensor::kGyro ? sensors.gyro_B_radps : sensors.accelerometer_B_mps2;
}

// Turns the attitude about the body's axes, so that it stays a unit quaternion.
void turn(const Eigen::Vector3d& turn_B_rad, sensors_t& sensors) {
  const double angle = turn_B_rad.norm();
  if (angle == 0) return;
  double* q = sensors.orientation;
  const Eigen::Quaterniond off = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) *
                                 Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d(turn_B_rad / angle)));
  q[0] = off.w();
  q[1] = off.x();
  q[2] = off.y();
  q[3] = off.z();
}

void keep(FaultSensor sensor, int axis, const sensors_t& from, sensors_t& to) {
  if (sensor == FaultSensor::kOrientation) std::copy_n(from.orientation, 4, to.orientation);
  if (sensor == FaultSensor::kLimitSwitch)
    std::copy_n(from.limit_switch, std::size(from.limit_switch), to.limit_switch);
  if (sensor != FaultSensor::kGyro && sensor != FaultSensor::kAccelerometer) return;
  sensors_t copy = from;
  for (int j = 0; j < 3; ++j) {
    if (axis < 0 || axis == j) axes(sensor, to)[j] = axes(sensor, copy)[j];
  }
}

void add(const sim::Fault& fault, const Eigen::Vector3d& value, sensors_t& sensors) {
  Eigen::Vector3d off = value;
  for (int j = 0; j < 3; ++j) {
    if (fault.axis >= 0 && fault.axis != j) off[j] = 0;
  }
  if (fault.sensor == FaultSensor::kOrientation) return turn(off, sensors);
  for (int j = 0; j < 3; ++j) axes(fault.sensor, sensors)[j] += off[j];
}

}  // namespace

SensorFaults::SensorFaults(const sim::Scenario& scenario) {
  for (std::size_t k = 0; k < scenario.faults.size(); ++k) {
    if (!scenario.faults[k].of(sim::FaultLayer::kSensor)) continue;
    std::uint64_t seed = scenario.seed + k;
    states_.push_back({scenario.faults[k], sim::random_bits(seed)});
  }
}

void SensorFaults::apply(double time_s, sensors_t& sensors) {
  if (states_.empty()) return;
  for (State& state : states_) {
    const sim::Fault& fault = state.fault;
    if (sensors.tick < 0 || !fault.active(time_s)) continue;
    switch (fault.kind) {
      case FaultKind::kSensorBias:
      case FaultKind::kSensorSpike:
        add(fault, Eigen::Vector3d::Constant(fault.value), sensors);
        break;
      case FaultKind::kSensorNoise: {
        Eigen::Vector3d noise;
        for (int j = 0; j < 3; ++j) noise[j] = fault.value * sim::normal(state.random);
        add(fault, noise, sensors);
        break;
      }
      case FaultKind::kSensorFreeze:
        if (!state.frozen) state.kept = previous_.value_or(sensors);
        state.frozen = true;
        keep(fault.sensor, fault.axis, state.kept, sensors);
        break;
      case FaultKind::kSensorNan:
        if (fault.sensor == FaultSensor::kOrientation) {
          std::fill_n(sensors.orientation, 4, std::numeric_limits<double>::quiet_NaN());
        } else {
          add(fault, Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()), sensors);
        }
        break;
      case FaultKind::kSensorSaturation:
        for (int j = 0; j < 3; ++j) {
          double& value = axes(fault.sensor, sensors)[j];
          if (fault.axis < 0 || fault.axis == j) value = std::clamp(value, -fault.value, fault.value);
        }
        break;
      default:
        break;
    }
  }
  previous_ = sensors;
}

}  // namespace ballast::sil
