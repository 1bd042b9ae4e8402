// The state that the plant has reached and the records of the run up to there.
#pragma once

#include "sim/plant/equations.h"
#include "sim/plant/extrema.h"
#include "sim/plant/motor_record.h"

namespace ballast::sim {

// One instant of a run.
struct Sample {
  double time_s;
  Regime regime;  // sliding too where rolling ends by slip, and the run with it; N and f_s are then still rolling's
  Eigen::Vector4d orientation;  // w, x, y, z
  Eigen::Vector3d angular_velocity_B_radps;
  Eigen::Vector3d position_W_m;
  Eigen::Vector3d velocity_W_mps;
  Eigen::Vector3d angular_acceleration_B_radps2;
  Eigen::Vector3d acceleration_B_mps2;  // of the geometric centre
  Eigen::Vector3d up_B;
  double normal_force_n;
  double static_friction_n;
  double normal_force_min_n;  // the least since the start of the tick
  double mu_required_max;     // the greatest f_s / N since then
  Eigen::Vector2d friction_force_W_n;
  Eigen::Vector3d center_of_mass_B_m;
  std::array<double, kMaxMasses> mass_position{};  // of a mass on a trajectory: the time, its rate 1, its torque 0
  std::array<double, kMaxMasses> mass_velocity{};
  std::array<Eigen::Vector3d, kMaxMasses> mass_position_B_m;
  std::array<double, kMaxMasses> motor_torque_nm{};
  std::array<std::int64_t, kMaxMasses> lost_steps{};
  double floor_static_friction;  // of the floor under the ball: the scenario's, unless a fault has changed it
  std::array<int, kMaxMasses> end_switches{};  // bit 0: at or beyond the lower end of its rail, bit 1: the upper
};

struct Progress {
  explicit Progress(const PlantModel& model);

  // Records contact and motors as they are now.
  void record();
  // The required friction alone, where the forces do not come about.
  void record_mu() { contact.record_mu(dynamics.equations, dynamics.time_s, dynamics.now.y, dynamics.now.motion); }
  // Determines which end stops push from now on.
  void update_stops();
  // The state now. The motors' torques are those of the last record().
  [[nodiscard]] Sample sample() const;
  [[nodiscard]] bool regime_over() const { return dynamics.equations.contact.over(dynamics.now.motion); }

  Dynamics dynamics;
  ContactRecord contact;
  MotorRecord motors;
};

}  // namespace ballast::sim
