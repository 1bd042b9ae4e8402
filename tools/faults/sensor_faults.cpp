#include "tools/faults/sensor_faults.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>
#include <span>

#include "sim/motors/random.h"

namespace ballast::sil {
namespace {

using sim::FaultKind;
using sim::FaultSensor;
using Offsets = std::array<double, std::size_t{sim::kMaxMasses}>;  // one per number of a sensor
static_assert(sim::kMaxMasses >= 3);

// The numbers of a sensor that are not an attitude or switches.
std::span<double> numbers(FaultSensor sensor, sensors_t& sensors) {
  if (sensor == FaultSensor::kGyro) return sensors.gyro_B_radps;
  if (sensor == FaultSensor::kAccelerometer) return sensors.accelerometer_B_mps2;
  if (sensor == FaultSensor::kPositionFix) return sensors.fix_W_m;
  if (sensor == FaultSensor::kEncoder) {
    return {sensors.encoder, static_cast<std::size_t>(std::clamp<int>(sensors.mass_count, 0, sim::kMaxMasses))};
  }
  return {};
}

// Whether the fault acts on this one of the sensor's numbers.
bool acts_on(const sim::Fault& fault, std::size_t number) {
  const int selected = fault.sensor == FaultSensor::kEncoder ? fault.mass : fault.axis;
  return selected < 0 || selected == static_cast<int>(number);
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

void keep(const sim::Fault& fault, sensors_t& from, sensors_t& to) {
  if (fault.sensor == FaultSensor::kOrientation) std::copy_n(from.orientation, 4, to.orientation);
  if (fault.sensor == FaultSensor::kLimitSwitch)
    std::copy_n(from.limit_switch, std::size(from.limit_switch), to.limit_switch);
  const std::span<double> kept = numbers(fault.sensor, from), now = numbers(fault.sensor, to);
  for (std::size_t j = 0; j < now.size(); ++j) {
    if (acts_on(fault, j)) now[j] = kept[j];
  }
}

void add(const sim::Fault& fault, const Offsets& value, sensors_t& sensors) {
  if (fault.sensor == FaultSensor::kOrientation) {
    Eigen::Vector3d off = Eigen::Vector3d::Zero();
    for (std::size_t j = 0; j < 3; ++j) {
      if (acts_on(fault, j)) off[static_cast<Eigen::Index>(j)] = value[j];
    }
    return turn(off, sensors);
  }
  const std::span<double> now = numbers(fault.sensor, sensors);
  for (std::size_t j = 0; j < now.size(); ++j) {
    now[j] += acts_on(fault, j) ? value[j] : 0;
  }
}

Offsets all(double value) {
  Offsets offsets{};
  offsets.fill(value);
  return offsets;
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
        add(fault, all(fault.value), sensors);
        break;
      case FaultKind::kSensorNoise: {
        Offsets noise{};
        const std::size_t count = std::max<std::size_t>(3, numbers(fault.sensor, sensors).size());
        for (std::size_t j = 0; j < count; ++j) noise[j] = fault.value * sim::normal(state.random);
        add(fault, noise, sensors);
        break;
      }
      case FaultKind::kSensorFreeze:
        if (!state.frozen) state.kept = previous_.value_or(sensors);
        state.frozen = true;
        keep(fault, state.kept, sensors);
        break;
      case FaultKind::kSensorNan:
        if (fault.sensor == FaultSensor::kOrientation) {
          std::fill_n(sensors.orientation, 4, std::numeric_limits<double>::quiet_NaN());
        } else {
          add(fault, all(std::numeric_limits<double>::quiet_NaN()), sensors);
        }
        break;
      case FaultKind::kSensorSaturation:
        for (std::size_t j = 0; double& value : numbers(fault.sensor, sensors)) {
          if (acts_on(fault, j++)) value = std::clamp(value, -fault.value, fault.value);
        }
        break;
      default:
        break;
    }
  }
  previous_ = sensors;
}

}  // namespace ballast::sil
