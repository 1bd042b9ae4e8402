// The physical side of a scenario: the ball, the floor, the masses and the state at t = 0. Units consistent.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "sim/masses/mass.h"

namespace ballast::sim {

struct Ball {
  double radius_m = 0;
  double mass_kg = 0;
  Eigen::Vector3d inertia_kgm2 = Eigen::Vector3d::Zero();        // principal, about the shell's own centre of mass
  Eigen::Vector3d center_of_mass_B_m = Eigen::Vector3d::Zero();  // from the geometric centre
};

// A part of the floor with friction and rolling resistance of its own: a polygon, or a circle where that is empty.
struct SurfacePatch {
  std::vector<Eigen::Vector2d> polygon_W_m;  // does not cross itself; either direction round
  Eigen::Vector2d center_W_m = Eigen::Vector2d::Zero();
  double radius_m = 0;
  double static_friction = std::numeric_limits<double>::infinity();
  double kinetic_friction = std::numeric_limits<double>::infinity();
  double rolling_resistance = 0;
};

struct Surface {
  double static_friction = std::numeric_limits<double>::infinity();
  double kinetic_friction = std::numeric_limits<double>::infinity();  // default: = static
  double restitution = 0;
  double rolling_resistance = 0;        // c_rr
  double spin_friction_m = 0;           // c_spin
  double creep_radps = 0;               // omega_c; 0: World::creep_radps() chooses it
  double slope_rad = 0;                 // of the floor; the space frame's third axis is its normal
  double downhill_rad = 0;              // direction of steepest descent in the floor, from e1 towards e2
  std::vector<SurfacePatch> patches{};  // where they overlap, the last one counts

  [[nodiscard]] double greatest_static_friction() const {
    double greatest = static_friction;
    for (const SurfacePatch& patch : patches) greatest = std::max(greatest, patch.static_friction);
    return greatest;
  }
  // Gives static friction everywhere that holds whatever the ball needs.
  void hold_everything() {
    static_friction = std::numeric_limits<double>::infinity();
    for (SurfacePatch& patch : patches) patch.static_friction = static_friction;
  }
};

// A force on the geometric centre over time, space frame: linear between the times, constant before and after them.
struct ForceTable {
  std::vector<double> times_s;  // increasing; empty: no table
  std::vector<Eigen::Vector3d> forces_W_n;
};

// The force -c |v| v, where v is the geometric centre's velocity relative to the wind.
struct Drag {
  double coefficient_kgpm = 0;  // c: N at 1 m/s
  Eigen::Vector3d wind_W_mps = Eigen::Vector3d::Zero();
};

struct InitialState {
  Eigen::Quaterniond orientation{1, 0, 0, 0};
  Eigen::Vector3d angular_velocity_B_radps = Eigen::Vector3d::Zero();
  Eigen::Vector2d position_W_m = Eigen::Vector2d::Zero();
  bool has_velocity = false;  // false: the rolling velocity
  Eigen::Vector3d velocity_W_mps = Eigen::Vector3d::Zero();
  double height_m = 0;
};

struct World {
  double gravity_mps2 = 0;
  Eigen::Vector3d external_force_W_n = Eigen::Vector3d::Zero();  // on the geometric centre; or a table in its place
  ForceTable force_table;
  Drag drag;
  Ball ball;
  Surface surface;
  std::vector<Mass> masses;  // 0..kMaxMasses
  InitialState initial;

  // omega_c, the rate below which rolling resistance and spin friction fade: physics.md, "Real floors".
  [[nodiscard]] double creep_radps() const {
    if (surface.creep_radps > 0) return surface.creep_radps;
    return gravity_mps2 > 0 ? 1e-3 * std::sqrt(gravity_mps2 / ball.radius_m) : 1e-3;
  }
};

}  // namespace ballast::sim
