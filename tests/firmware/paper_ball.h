// The paper's ball (section "Numerical simulations of the rolling ball") with a motor on each rail.
#pragma once

#include <cmath>
#include <numbers>

#include "firmware/control/controller.h"

namespace ballast::firmware::testing {

inline constexpr Wide kPi = std::numbers::pi_v<Wide>;

inline BallParams paper_ball() {
  BallParams ball;
  ball.radius_m = 1;
  ball.gravity_mps2 = 1;
  ball.shell_mass_kg = 1;
  ball.inertia_kgm2 = Vector3(0.9, 1.0, 1.1);
  ball.center_of_mass_B_m = Vector3(0, 0, -0.05);
  ball.mass_count = 3;
  ball.mass_kg = {1, 1, 1};
  ball.rail[0] = circle_about(0.95, 0, 0);
  ball.rail[1] = circle_about(0.90, kPi / 2, 0);
  ball.rail[2] = circle_about(0.85, kPi / 4, kPi / 4);
  return ball;
}

// A closed spline rail with knots on a wavy circle. M_i-1 + 4 M_i + M_i+1 = 6 (y_i-1 - 2 y_i + y_i+1) / h^2 makes it
// C2; of a sine of m waves around, sampled at steps of angle, that is M_i = -6 (1 - cos m angle) / ((2 + cos m angle)
// h^2) y_i.
inline Rail wavy_spline() {
  Rail rail;
  rail.shape = RailShape::kSpline;
  rail.closed = true;
  rail.piece_count = kMaxRailPieces;
  const Wide angle = 2 * kPi / kMaxRailPieces;
  rail.piece_length_m = static_cast<Real>(0.8 * angle);
  const auto bend = [&](int waves) {
    const Wide c = std::cos(waves * angle);
    return -6 * (1 - c) / ((2 + c) * rail.piece_length_m * rail.piece_length_m);
  };
  for (int k = 0; k < kMaxRailPieces; ++k) {
    const Eigen::Vector3d p(0.8 * std::cos(k * angle), 0.1 * std::sin(3 * k * angle), 0.8 * std::sin(k * angle));
    const Eigen::Vector3d second(bend(1) * p[0], bend(3) * p[1], bend(1) * p[2]);
    rail.knots[static_cast<std::size_t>(k)] = {p.cast<Real>(), second.cast<Real>()};
  }
  rail.knots[kMaxRailPieces] = rail.knots[0];
  return rail;
}

// theta_a of eq_ball_initial_conds_spec.
inline constexpr Wide kPaperStart[3] = {0, 2.0369, 0.7044};

// eq_prescribed_u_ball: 1 for 0.1 s, then linearly to 0 in 0.1 s.
inline constexpr ProfilePiece kPaperMotion[2] = {{0.1, 1, 1}, {0.1, 1, 0}};

inline ControllerParams paper_params() {
  ControllerParams p;
  p.scenario_id = 4711;
  p.control_period_s = 0.001;
  p.timer_frequency_hz = 1e7;
  p.static_friction = 0.35;
  p.sensor_stale_ticks = 3;
  p.monitor_stale_ticks = 5;
  p.ball = paper_ball();
  for (std::size_t i = 0; i < 3; ++i) {
    p.motor[i] = {3200 / (2 * kPi), 25000, 2, 20};
    static_cast<void>(p.motion[i].set(kPaperStart[i], 0, kPaperMotion, 2));
  }
  return p;
}

}  // namespace ballast::firmware::testing
