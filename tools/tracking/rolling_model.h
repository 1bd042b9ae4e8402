// The rolling ball with prescribed masses, and its exact first derivatives, for the planner.
//
// Values are those of firmware::rolling_forces() (eq_Om_1d, eq_normal_1d, eq_static_friction_1d), on floors that slope
// and resist too. Derivatives are derived by hand from the same equations: a derivative of Omegadot = A^-1 b is
// A^-1 (db - dA Omegadot), so that all columns share one inverse. tests/plan compares values with the firmware's and
// derivatives with those by complex step.
//
// Attitude is differentiated by a rotation vector phi in the body frame, Lambda -> Lambda exp(phi^): d(Lambda^T v) =
// (Lambda^T v) x phi.
#pragma once

#include <array>

#include "firmware/model/ball.h"
#include "sim/plant/vec3.h"

namespace ballast::plan {

using firmware::kMaxMasses;
using Vec = sim::Vec3<double>;
template <class T>
using PerMass = std::array<T, kMaxMasses>;

// The ball and its masses, and what the motors add: J_i, in rail units (physics.md section 5).
struct Robot {
  firmware::BallParams ball;
  PerMass<double> reflected_inertia{};
};

// The ball's state at one instant. q: w, x, y, z, body to space, of unit length up to rounding.
struct RollingState {
  std::array<double, 4> q{1, 0, 0, 0};
  Vec omega_B{0, 0, 0};
  PerMass<double> position{}, velocity{}, acceleration{};  // of the masses, rail units
};

// The rolling ball at that instant.
struct RollingValue {
  Vec omega_dot_B;
  double normal_n;                     // N
  std::array<double, 2> force_n;       // -f_s sigma, space frame
  std::array<double, 2> velocity_mps;  // of the geometric centre, space frame
  PerMass<double> torque;              // generalised force of each motor, rotor included: N m on a circle, N on a line
};

// Columns of the derivatives: phi (3), Omega (3), then position, velocity and acceleration, mass by mass: 3 (i + 2) +
// 0, 1, 2 for mass i.
inline constexpr int kStateColumns = 6;
inline constexpr int kMaxColumns = kStateColumns + 3 * kMaxMasses;

struct RollingDerivative {
  int columns;  // 6 + 3 n
  std::array<Vec, kMaxColumns> omega_dot_B;
  std::array<double, kMaxColumns> normal_n;
  std::array<std::array<double, kMaxColumns>, 2> force_n;
  std::array<std::array<double, kStateColumns>, 2> velocity_mps;
  std::array<std::array<double, kMaxColumns>, kMaxMasses> torque;  // [mass][column]; only on request
};

void evaluate_rolling(const Robot& robot, const RollingState& state, RollingValue& value);

// Value and derivative in one pass. The torques and their derivatives are set only `with_torque`.
void differentiate_rolling(const Robot& robot, const RollingState& state, bool with_torque, RollingValue& value,
                           RollingDerivative& derivative);

// The floor's weight is not along its normal; it gives a moment.
inline bool slopes(const firmware::BallParams& ball) { return ball.down_W[0] != 0 || ball.down_W[1] != 0; }
inline bool resists(const firmware::BallParams& ball) {
  return ball.rolling_resistance > 0 || ball.spin_friction_m > 0;
}

// Lambda v and Lambda^T v.
Vec to_space(const std::array<double, 4>& q, const Vec& v_B);
Vec to_body(const std::array<double, 4>& q, const Vec& v_W);

}  // namespace ballast::plan
