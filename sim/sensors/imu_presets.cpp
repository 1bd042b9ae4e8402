#include "sim/sensors/imu_presets.h"

#include <array>
#include <numbers>

namespace ballast::sim {

namespace {

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMilliG = 9.80665e-3;
constexpr double kMicroG = 1e-3 * kMilliG;

constexpr double kGyroWalk = 1e-5;           // rad/s/sqrt(s)
constexpr double kAccelerometerWalk = 1e-4;  // m/s^2/sqrt(s)

constexpr ImuTriad bmi088_gyro() {
  return {.noise_density = 0.014 * kDegree,
          .bias = 1 * kDegree,
          .bias_walk = kGyroWalk,
          .scale_error = 0.01,
          .misalignment_rad = 0.01,
          .range = 2000 * kDegree,
          .resolution = kDegree / 16.384};
}

constexpr ImuTriad bmi088_accelerometer() {
  return {.noise_density = 175 * kMicroG,
          .bias = 20 * kMilliG,
          .bias_walk = kAccelerometerWalk,
          .scale_error = 0.005,
          .misalignment_rad = 0.005,
          .range = 6e3 * kMilliG,
          .resolution = 6e3 * kMilliG / 32768};
}

constexpr ImuTriad icm42688p_gyro() {
  return {.noise_density = 0.0028 * kDegree,
          .bias = 0.5 * kDegree,
          .bias_walk = kGyroWalk,
          .scale_error = 0.005,
          .misalignment_rad = 0.0125,
          .range = 2000 * kDegree,
          .resolution = kDegree / 16.4};
}

constexpr ImuTriad icm42688p_accelerometer() {
  return {.noise_density = 70 * kMicroG,
          .bias = 20 * kMilliG,
          .bias_walk = kAccelerometerWalk,
          .scale_error = 0.005,
          .misalignment_rad = 0.01,
          .range = 16e3 * kMilliG,
          .resolution = 1e3 * kMilliG / 2048};
}

constexpr ImuTriad lsm6dso_gyro() {
  return {.noise_density = 0.0038 * kDegree,
          .bias = 1 * kDegree,
          .bias_walk = kGyroWalk,
          .scale_error = 0.01,
          .misalignment_rad = 0.01,
          .range = 2000 * kDegree,
          .resolution = 0.07 * kDegree};
}

constexpr ImuTriad lsm6dso_accelerometer() {
  return {.noise_density = 70 * kMicroG,
          .bias = 20 * kMilliG,
          .bias_walk = kAccelerometerWalk,
          .scale_error = 0.01,
          .misalignment_rad = 0.01,
          .range = 4e3 * kMilliG,
          .resolution = 0.122 * kMilliG};
}

// Residuals after a calibration: a gyroscope's offset is removed at rest and comes back with temperature.
constexpr ImuTriad calibrated_gyro(ImuTriad gyro) {
  gyro.bias = 0.1 * kDegree;
  gyro.scale_error = 0.002;
  gyro.misalignment_rad = 0.002;
  return gyro;
}

constexpr ImuTriad calibrated_accelerometer(ImuTriad accelerometer) {
  accelerometer.bias = 2 * kMilliG;
  accelerometer.scale_error = 0.001;
  accelerometer.misalignment_rad = 0.002;
  return accelerometer;
}

constexpr std::string_view kBmi088 =
    "Bosch Sensortec BMI088, datasheet BST-BMI088-DS001 rev. 1.4, tables 2 and 3; axes' misalignment: its cross axis "
    "sensitivities";
constexpr std::string_view kIcm42688p = "TDK InvenSense ICM-42688-P, datasheet DS-000347 rev. 1.7, tables 1 and 2";
constexpr std::string_view kLsm6dso =
    "STMicroelectronics LSM6DSO, datasheet DS12140 rev. 2, table 2; it prints no misalignment: 0.01 rad is assumed";

constexpr std::array kPresets{
    ImuPreset{"bmi088", kBmi088, bmi088_gyro(), bmi088_accelerometer()},
    ImuPreset{"bmi088_calibrated", kBmi088, calibrated_gyro(bmi088_gyro()),
              calibrated_accelerometer(bmi088_accelerometer())},
    ImuPreset{"icm42688p", kIcm42688p, icm42688p_gyro(), icm42688p_accelerometer()},
    ImuPreset{"icm42688p_calibrated", kIcm42688p, calibrated_gyro(icm42688p_gyro()),
              calibrated_accelerometer(icm42688p_accelerometer())},
    ImuPreset{"lsm6dso", kLsm6dso, lsm6dso_gyro(), lsm6dso_accelerometer()},
    ImuPreset{"lsm6dso_calibrated", kLsm6dso, calibrated_gyro(lsm6dso_gyro()),
              calibrated_accelerometer(lsm6dso_accelerometer())},
};

}  // namespace

std::span<const ImuPreset> imu_presets() { return kPresets; }

}  // namespace ballast::sim
