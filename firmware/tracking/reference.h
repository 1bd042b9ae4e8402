// The reference that the controller tracks, and the feedback gains about it. Types only.
#pragma once

#include <array>
#include <cstddef>

#include "firmware/model/types.h"

namespace ballast::firmware {

inline constexpr int kMostReferenceFloats = 8192;  // 32 kB

// Rows at equal times, row k at plan time k period_s: attitude (w, x, y, z; body -> space, unit, each of the sign
// nearer to the row before), Omega (3, body frame, rad/s), place of the geometric centre (2, space frame, m), and the
// gain K by rows: a row per mass with the columns of the error e.
//
// e has 2 n + 10 components: the masses' positions (n) and rates (n) in rail units; the rotation vector that turns the
// planned attitude into the true one (3, body frame); Omega (3, body frame); the place (2, space frame); the integral
// of the place's error over time (2, m s). The masses' own reference is ControllerParams::motion.
struct ReferenceTable {
  int samples = 0;  // 0: nothing is tracked; otherwise at least 2
  Wide period_s = 0;
  // The reference ends at rest: its last row is held for ever. False: feedback ends with the table.
  bool holds = false;
  std::array<float, kMostReferenceFloats> values{};
};

inline constexpr int kReferenceStateFloats = 9;

constexpr int error_size(int masses) { return 2 * masses + 10; }
constexpr int reference_row(int masses) { return kReferenceStateFloats + masses * error_size(masses); }
inline constexpr int kMostErrorSize = error_size(kMaxMasses);

// State of the ball that is compared with the reference.
struct BallState {
  Quaternion orientation{1, 0, 0, 0};  // body -> space, unit
  Vector3 angular_velocity_B_radps = Vector3::Zero();
  Vector2 position_W_m = Vector2::Zero();  // of the geometric centre
};

}  // namespace ballast::firmware
