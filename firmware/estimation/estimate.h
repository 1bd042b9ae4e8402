// Input and output of the estimation on board. Types only.
#pragma once

#include "firmware/model/types.h"

namespace ballast::firmware {

// Errors of one triad of the IMU, 1 sigma of each axis, as the designer of the robot states them. 0: none.
struct TriadErrors {
  Real noise = 0;             // of a sample, rad/s or m/s^2
  Real bias = 0;              // drawn once, rad/s or m/s^2
  Real bias_walk = 0;         // the bias gains this times sqrt(dt), per sqrt(s)
  Real scale_error = 0;       // 1
  Real misalignment_rad = 0;  // of the triad's axes
  Real range = 0;             // greatest magnitude of a reading; 0: unlimited
  Real resolution = 0;        // readings are multiples of it
};

// Everything that the estimation knows of the sensors, and where the ball is set down.
struct EstimationParams {
  bool estimated = false;         // false: the attitude is sensed, and no filter runs
  bool measures_contact = false;  // there is an IMU with stated errors: N and f_s are measured
  int imu_period_ticks = 1;       // control ticks from one sample to the next, >= 1
  int imu_latency_ticks = 0;      // age of a sample when it arrives, >= 0
  TriadErrors gyro;
  TriadErrors accelerometer;
  Vector3 accelerometer_position_B_m = Vector3::Zero();  // from the geometric centre
  int fix_delay_ticks = 0;                               // age of a place from outside when it arrives
  Real fix_noise_m = 0;                                  // 1 sigma of each component
  bool has_encoders = false;
  PerMass<Real> encoder_resolution{};  // rail units
  // Where the ball is set down: known to the controller as the motion is. Tilt is measured by the accelerometer in the
  // hold, heading and place are taken from here.
  Quaternion initial_orientation{1, 0, 0, 0};  // body -> space, unit
  Vector3 initial_angular_velocity_B_radps = Vector3::Zero();
  Vector2 initial_position_W_m = Vector2::Zero();
};

// The filter's belief at the start of a control tick, with 1-sigma bands.
struct Estimate {
  bool valid = false;                  // false: no sample has arrived yet, or the filter has nothing to go on
  Quaternion orientation{1, 0, 0, 0};  // body -> space, unit
  Vector3 angular_velocity_B_radps = Vector3::Zero();
  Vector3 gyro_bias_B_radps = Vector3::Zero();
  Vector2 position_W_m = Vector2::Zero();  // of the geometric centre
  Real tilt_sigma_rad = 0;                 // of each of the two components
  Real yaw_sigma_rad = 0;                  // not observable without help: grows
  Real gyro_bias_sigma_radps = 0;          // greatest of the three axes
  Real position_sigma_m = 0;               // greatest direction
};

// The contact force as the robot measures it: Newton's law with the accelerometer and the masses' motion (physics.md,
// "What a robot can know"). No rolling is assumed.
struct MeasuredContact {
  bool valid = false;
  Real normal_force_n = 0;
  Real normal_sigma_n = 0;
  Real static_friction_n = 0;
  Real mu_required = 0;  // f_s / N; +infinity where N <= 0
  Real mu_sigma = 0;     // 1 sigma of mu_required; +infinity where that is
  Real slip_mps2 = 0;    // magnitude of the contact point's acceleration against the floor, filtered
  Real slip_sigma_mps2 = 0;
  bool slip_detected = false;   // the contact point slips (measured_contact.h states the rate of false alarms)
  bool light_detected = false;  // the ball presses on the floor with less than a part of its weight
};

}  // namespace ballast::firmware
