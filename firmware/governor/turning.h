// Rates of attitude, angular velocity and place of a rolling ball, for steps of the classic Runge-Kutta rule.
#pragma once

#include <cmath>

#include "firmware/governor/robot_state.h"

namespace ballast::firmware {

struct TurningRate {
  Eigen::Matrix<Real, 4, 1> orientation = Eigen::Matrix<Real, 4, 1>::Zero();  // w, x, y, z
  Vector3 angular_velocity = Vector3::Zero();
  Vector2 position = Vector2::Zero();

  void add(const TurningRate& rate, Real h_s) {
    orientation += h_s * rate.orientation;
    angular_velocity += h_s * rate.angular_velocity;
    position += h_s * rate.position;
  }
};

// qdot = q (0, Omega) / 2 and zdot = omega x r e3.
inline TurningRate turning_rate(const Quaternion& q, const Vector3& omega_B, const Vector3& omega_dot_B,
                                Real radius_m) {
  const Real w = q.w(), x = q.x(), y = q.y(), z = q.z();
  const Real a = omega_B[0], b = omega_B[1], c = omega_B[2];
  TurningRate rate;
  rate.orientation << (-x * a - y * b - z * c) / 2, (w * a + y * c - z * b) / 2, (w * b + z * a - x * c) / 2,
      (w * c + x * b - y * a) / 2;
  rate.angular_velocity = omega_dot_B;
  const Real omega_1 = (1 - 2 * (y * y + z * z)) * a + 2 * (x * y - w * z) * b + 2 * (x * z + w * y) * c;
  const Real omega_2 = 2 * (x * y + w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z - w * x) * c;
  rate.position = Vector2(radius_m * omega_2, -radius_m * omega_1);
  return rate;
}

// q + h qdot, with unit length.
inline Quaternion turned(const Quaternion& q, const Eigen::Matrix<Real, 4, 1>& rate, Real h_s) {
  const Real w = q.w() + h_s * rate[0], x = q.x() + h_s * rate[1], y = q.y() + h_s * rate[2], z = q.z() + h_s * rate[3];
  const Real norm = std::sqrt(w * w + x * x + y * y + z * z);
  return {w / norm, x / norm, y / norm, z / norm};
}

inline void apply(const TurningRate& change, RobotState& state) {
  state.orientation = turned(state.orientation, change.orientation, 1);
  state.angular_velocity_B_radps += change.angular_velocity;
  state.position_W_m += change.position;
}

}  // namespace ballast::firmware
