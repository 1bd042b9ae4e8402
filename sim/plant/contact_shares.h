// Shares of the contact force: N and f by mass, at one instant of rolling. Derivation: physics.md, "Whose friction it
// is".
//
// In rolling the contact force is linear in the loads on the ball. Each mass has three loads: its weight, its own
// motion in the body (Coriolis term included), and its motion with the turning ball. The shell has the first and the
// third, and the external force and the floor's moment are loads of their own. So R is the sum of the forces that each
// load would cause alone in a ball with all the inertia of this one:
//   R = sum R_k.
// A load needs friction in two ways: it pushes along f, or it lifts. Its share of f_s / N counts both. With sigma the
// direction of f, mu = f_s / N, w_k the weight in load k and W = sum w_k,
//   mu_k = (R_k . sigma + mu (w_k - R_k . e3)) / W,     sum mu_k = mu,
// because f_s = mu N.
#pragma once

#include <Eigen/Core>
#include <array>

#include "sim/plant/newton_euler.h"

namespace ballast::sim {

// Parts of the contact force, N, space frame (third entry: of N).
struct LoadShare {
  Eigen::Vector3d weight_W_n = Eigen::Vector3d::Zero();   // from its weight
  Eigen::Vector3d motion_W_n = Eigen::Vector3d::Zero();   // from its own motion in the body; the shell has none
  Eigen::Vector3d turning_W_n = Eigen::Vector3d::Zero();  // from its motion with the turning ball
  double static_weight_n = 0;                             // its weight on the floor at rest

  [[nodiscard]] Eigen::Vector3d total_W_n() const { return weight_W_n + motion_W_n + turning_W_n; }
};

struct ContactShares {
  int mass_count = 0;
  std::array<LoadShare, kMaxMasses> mass;
  LoadShare shell;                                      // with its static internals
  LoadShare outside;                                    // of the external force; all of it is stored as its weight
  LoadShare floor;                                      // of the floor's moment; all of it is stored as its turning
  Eigen::Vector3d force_W_n = Eigen::Vector3d::Zero();  // R, the sum of all
  double static_weight_n = 0;                           // W, likewise
};

// mu_k / mu of `part_W_n`: its contribution to f_s / N, as a part of it. `static_weight_n` is the part's share of W (0
// for all but weights). Where N <= 0 the ratio has no bound; the result is then the limit, in which only lifting
// counts, divided by the whole lift W - N. NaN where nothing presses the ball on the floor at rest (W <= 0) or no
// friction is needed.
double part_of_friction(const ContactShares& shares, const Eigen::Vector3d& part_W_n, double static_weight_n);

// The same for a whole load.
inline double part_of_friction(const ContactShares& shares, const LoadShare& load) {
  return part_of_friction(shares, load.total_W_n(), load.static_weight_n);
}

// Rolling only. Driven masses are given as they move, like prescribed ones.
ContactShares contact_shares(const Body& body, double time_s, const double* q, const double* angular_velocity_B,
                             const CarriedMasses& masses);

}  // namespace ballast::sim
