// The robot rolled along a recorded motion of its masses, as its IMU would see it. Rolling without slip, by the model
// of tools/tracking/rolling_model.h and classical Runge-Kutta steps.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "tools/identify/recording.h"

namespace ballast::identify {

// Steps in a window, over which samples are averaged: even, for Simpson's rule.
inline constexpr int kStepsPerWindow = 4;

// Attitude, rate and place at one instant.
struct BallState {
  std::array<double, 4> q{1, 0, 0, 0};  // w x y z, body to space
  Eigen::Vector3d omega_B_radps = Eigen::Vector3d::Zero();
  Eigen::Vector2d place_W_m = Eigen::Vector2d::Zero();
};

// Turned by the rotation vector phi (body frame).
[[nodiscard]] BallState turned(const BallState& state, const Eigen::Vector3d& phi_B);

// The state and what the IMU reads there without errors.
struct Node {
  BallState state;
  Eigen::Vector3d specific_force_B_mps2;  // at the accelerometer
  double normal_n = 0, friction_n = 0;    // N, f_s
};

// The masses' motion at steps and halves of steps.
class Timeline {
 public:
  Timeline(const std::vector<firmware::MassMotion>& at_ticks, const Known& known);

  [[nodiscard]] int step_ticks() const { return step_ticks_; }
  [[nodiscard]] int window_ticks() const { return kStepsPerWindow * step_ticks_; }
  [[nodiscard]] int windows() const { return windows_; }
  [[nodiscard]] double step_s() const { return step_s_; }
  [[nodiscard]] double window_s() const { return kStepsPerWindow * step_s_; }
  [[nodiscard]] const firmware::MassMotion& at_half(int half_steps) const {
    return halves_[static_cast<std::size_t>(half_steps)];
  }
  // As it is commanded, without lag and offset.
  [[nodiscard]] const firmware::MassMotion& commanded_at_half(int half_steps) const {
    return commanded_[static_cast<std::size_t>(half_steps)];
  }
  // Sets the lag of the masses at the nodes, in rail units. The timeline has at least one window.
  void set_lag(const std::vector<plan::PerMass<double>>& at_nodes);
  // Moves the masses as they are commanded to move, plus `offset`, less `factor` times the lag.
  void place(const plan::PerMass<double>& offset, const plan::PerMass<double>& factor);

 private:
  int step_ticks_, windows_;
  double step_s_;
  std::vector<firmware::MassMotion> commanded_, halves_;
  std::vector<firmware::MassMotion> lag_;  // at halves of steps; empty: none
};

// Rolls from the start of a window over so many windows. `nodes` has kStepsPerWindow * windows + 1 of them.
void roll(const plan::Robot& robot, const Eigen::Vector3d& accelerometer_B_m, const Timeline& timeline,
          int first_window, int windows, const BallState& start, std::vector<Node>& nodes);

// Lag of each mass behind its command at the nodes of a rollout: the force its motor must supply for the commanded
// motion, or for the `lagging` one, over its stiffness.
// The generalised force has the weight and the acceleration of mass and rotor, and the viscous friction of its drive.
void lag_along(const plan::Robot& robot, const Known& known, const Timeline& timeline, int first_window,
               const std::vector<Node>& nodes, bool lagging, std::vector<plan::PerMass<double>>& lag);

// -Lambda^T g_W, what an accelerometer reads at rest.
[[nodiscard]] Eigen::Vector3d held_force_B(const firmware::BallParams& ball, const BallState& state);

}  // namespace ballast::identify
