// A ball with one moving mass, which examples 01 and 04 control: 0.8 kg, 0.15 m, a mass of 0.4 kg on an upright circle.
#pragma once

#include <numbers>

#include "firmware/control/params.h"

inline constexpr double kStepsPerRadian = 3200 / (2 * std::numbers::pi);  // 200 full steps of 16 microsteps

// The parameters that a controller gets before its first tick, with a motion of two seconds: up to speed in the first,
// back to rest in the second.
inline ballast::firmware::ControllerParams one_mass() {
  using namespace ballast::firmware;
  ControllerParams params;
  params.control_period_s = 0.001;
  params.timer_frequency_hz = 1e6;  // of the timer that the pulses are counted in
  params.static_friction = 0.5;
  params.sensor_stale_ticks = 3;   // older sensors are a fault
  params.monitor_stale_ticks = 3;  // so is an older verdict

  params.ball.radius_m = 0.15;
  params.ball.gravity_mps2 = 9.81;
  params.ball.shell_mass_kg = 0.8;
  params.ball.inertia_kgm2 = Vector3(0.012, 0.012, 0.012);
  params.ball.mass_count = 1;
  params.ball.mass_kg[0] = 0.4;
  // At 0 the mass hangs at the bottom of its circle, at pi/2 it is in front.
  params.ball.rail[0] = circle(Vector3::Zero(), 0.1, -Vector3::UnitZ(), Vector3::UnitX());

  MotorParams& motor = params.motor[0];
  motor.steps_per_unit = kStepsPerRadian;
  motor.max_step_rate_hz = 8000;
  motor.max_acceleration = 2;  // rad/s^2
  motor.max_jerk = 20;         // rad/s^3
  motor.direction_setup_s = 5e-6;

  // Each piece: duration, acceleration at its start and at its end, rad/s^2.
  const ProfilePiece motion[] = {{0.5, 0, 0.4}, {0.5, 0.4, 0}, {0.5, 0, -0.4}, {0.5, -0.4, 0}};
  static_cast<void>(params.motion[0].set(/*initial_position=*/0, /*initial_velocity=*/0, motion, 4));
  return params;
}
