// Data of the robot's sensors: the table [sensors] of a scenario. Units are consistent; "1 sigma" is the standard
// deviation of a normal distribution.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace ballast::sim {

// Three axes of a gyroscope (rad/s) or an accelerometer (m/s^2). Zero: no such error, or no such limit.
struct ImuTriad {
  double noise_density = 0;     // unit / sqrt(Hz), one-sided as datasheets print it
  double bias = 0;              // unit, 1 sigma of each axis, drawn once per run
  double bias_walk = 0;         // unit / sqrt(s): the bias gains this times sqrt(dt), 1 sigma
  double scale_error = 0;       // 1, 1 sigma of each axis, drawn once per run
  double misalignment_rad = 0;  // 1 sigma of the turn about each axis, drawn once per run
  double range = 0;             // unit: greatest magnitude of a reading
  double resolution = 0;        // unit: readings are multiples of it
};

// Place of the geometric centre in the floor, seen from outside.
struct PositionFix {
  double rate_hz = 0;  // 0: there is none
  double noise_m = 0;  // 1 sigma of each component
  double delay_s = 0;
};

struct SensorModel {
  bool present = false;  // false: ideal sensors, at every tick
  std::string preset;    // empty: none
  // False: a fused IMU senses the attitude. True: nothing does, and the firmware estimates it.
  bool attitude_estimated = false;
  double rate_hz = 0;  // of the IMU
  double latency_s = 0;
  ImuTriad gyro;
  ImuTriad accelerometer;
  Eigen::Vector3d accelerometer_position_B_m = Eigen::Vector3d::Zero();  // from the geometric centre
  PositionFix fix;
  std::vector<double> encoder_resolution;  // rail units, of each mass; empty: no encoders
};

}  // namespace ballast::sim
