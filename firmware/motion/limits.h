// Limits of one motor's motion, and of the profiles planned within them. Types only.
#pragma once

#include "firmware/model/types.h"

namespace ballast::firmware {

// Rail unit per s, s^2, s^3; each finite and > 0.
struct MotionLimits {
  Wide max_velocity = 0;
  Wide max_acceleration = 0;
  Wide max_jerk = 0;
};

inline constexpr int kMaxPlannedPieces = 7;  // of a stop or a move

}  // namespace ballast::firmware
