// One internal mass as a scenario describes it: its rail and the motion along it, or its trajectory, and its motor.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "firmware/model/rail.h"
#include "sim/motors/end_stop.h"
#include "sim/motors/motor.h"

namespace ballast::sim {

inline constexpr int kMaxMasses = firmware::kMaxMasses;

// theta'' changes linearly from acceleration_start to acceleration_end over duration_s.
struct MotionPiece {
  double duration_s = 0;
  double acceleration_start = 0;
  double acceleration_end = 0;
};

// chi(t) itself, in place of a rail and a motion along it: the paper's section 3. Prescribed runs only.
struct Trajectory {
  std::vector<double> times_s;  // increasing; empty: the mass is on its rail
  std::vector<Eigen::Vector3d> points_B_m;
  bool periodic = false;  // the table repeats for ever; its last point is its first
};

struct Mass {
  double mass_kg = 0;
  firmware::Rail rail;
  EndStopMaterial end_stops;  // where the rail has ends
  Trajectory trajectory;
  // The following belong to a mass on a rail.
  double initial_position = 0;  // rad or m
  double initial_velocity = 0;
  std::vector<MotionPiece> motion;
  Motor motor;
  bool motor_limited = false;  // the file sets a limit of its motor (max_..); else all are derived from the motion

  // |zeta'|: metres of path per rail unit. A spline's is 1 within the tolerance of spline_rail.h.
  [[nodiscard]] double metres_per_rail_unit() const {
    return rail.shape == firmware::RailShape::kCircle ? rail.radius_m : 1;
  }
  // Mass and rotor, in rail units.
  [[nodiscard]] double moving_inertia() const {
    return mass_kg * metres_per_rail_unit() * metres_per_rail_unit() + motor.rail_inertia();
  }
  // The angular frequency at which rotor and mass swing about the field of a motor at rest.
  [[nodiscard]] double swing_radps() const { return std::sqrt(motor.rail_stiffness() / moving_inertia()); }
  // The damping ratio of that swing.
  [[nodiscard]] double damping_ratio() const {
    const double damping = motor.viscous_damping_nms * motor.shaft_ratio * motor.shaft_ratio;
    return damping / (2 * std::sqrt(motor.rail_stiffness() * moving_inertia()));
  }
};

}  // namespace ballast::sim
