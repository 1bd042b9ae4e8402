// Ball and masses as the governor rolls them forward. Types only.
#pragma once

#include "firmware/model/ball.h"

namespace ballast::firmware {

struct RobotState {
  Quaternion orientation{1, 0, 0, 0};  // body -> space, unit
  Vector3 angular_velocity_B_radps = Vector3::Zero();
  Vector2 position_W_m = Vector2::Zero();  // of the geometric centre
  PerMass<Real> mass_position{};           // rail coordinates
  PerMass<Real> mass_velocity{};
  PerMass<Real> mass_acceleration{};  // commanded
  // True acceleration and jerk of a mass that swings in its motor's field (governor_params.h).
  PerMass<Real> swing_acceleration{}, swing_jerk{};
};

}  // namespace ballast::firmware
