// Parameters of the controller.
#pragma once

#include "firmware/estimation/estimate.h"
#include "firmware/governor/governor_params.h"
#include "firmware/model/ball.h"
#include "firmware/motion/profile.h"
#include "firmware/tracking/reference.h"

namespace ballast::firmware {

struct MotorParams {
  Wide steps_per_unit = 0;     // microsteps per rail unit (rad or m), != 0; sign = wiring
  Wide max_step_rate_hz = 0;   // microsteps per second, > 0, at most (sure_steps_per_tick() - 1) / control_period_s
  Wide max_acceleration = 0;   // rail unit / s^2, > 0: of motion, moves and stops
  Wide max_jerk = 0;           // rail unit / s^3, > 0: of the same, inside the motion's pieces
  Wide direction_setup_s = 0;  // 0..1e-3: least time between two opposite pulses, which the driver needs to turn
  Wide swing = 0;              // rail unit, >= 0: the rotor may be off by this and lose no step (two full steps)
};

// Everything that the controller gets before its first tick. Inert until validate() accepts it.
struct ControllerParams {
  std::int64_t scenario_id = 0;  // fingerprint, echoed in the status
  Wide control_period_s = 0;
  Wide timer_frequency_hz = 0;  // step timer, 1e6..1e8
  Real static_friction = 0;     // mu_s > 0; infinity: perfect friction
  int sensor_stale_ticks = 0;   // sensors may be this many ticks old
  int monitor_stale_ticks = 0;  // heartbeat may be this many ticks old
  BallParams ball;
  EstimationParams estimation;
  PerMass<MotorParams> motor{};
  PerMass<Profile> motion{};  // runs on a start; its initial position is where the masses stand
  ReferenceTable tracking;    // about that motion; the first start after reset() follows it
  GovernorSettings governor;  // bends the running motion
};

// Reason for which parameters were refused.
struct ParamError {
  const char* field = nullptr;  // nullptr: accepted
  int index = -1;               // mass, where the field has one
  int piece = -1;               // of the motion, where the field is one
  Wide value = 0;
  const char* allowed = "";
  Wide limit = 0;  // what was allowed, in the unit of `value`; 0 where `allowed` says it all
  [[nodiscard]] bool ok() const { return field == nullptr; }
};

// Returns the first parameter that is out of range, with its value and what is allowed.
[[nodiscard]] ParamError validate(const ControllerParams& params);

// Limits that the profiles of a motor keep. The speed is that of its step rate.
[[nodiscard]] MotionLimits motion_limits(const ControllerParams& params, int mass);

// The governor's limits, from these and the robot's own.
[[nodiscard]] GovernorParams governor_params(const ControllerParams& params);

}  // namespace ballast::firmware
