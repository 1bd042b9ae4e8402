// A hybrid stepper and its driver as a scenario describes them: physics.md section 5. Torques, angles and speeds are
// those of the shaft, but where a name says rail: phi = shaft_ratio * theta turns rail units into motor angle.
#pragma once

#include <numbers>

namespace ballast::sim {

struct Motor {
  int steps_per_revolution = 200;    // full steps, a multiple of 4
  int microsteps = 16;               // 1..256
  double gear_ratio = 1.0;           // motor turns per turn of a circle rail; circles only
  double travel_per_revolution = 0;  // m of rail per motor turn; lines and splines only
  double holding_torque_nm = 0;      // tau_hold at standstill
  double detent_torque_nm = 0;
  double rotor_inertia_kgm2 = 0;
  double viscous_damping_nms = 0;  // b
  double corner_speed_radps = 0;   // The full tau_hold is available up to this speed. Above it tau_hold falls as corner
                                   // / speed, or with the currents where a winding is given (then this is derived).
  double rated_current_a = 0;      // rms, per phase, both phases on; 0: neither a winding nor the next three are given
  double resistance_ohm = 0;       // per phase
  double inductance_h = 0;         // per phase
  double supply_voltage_v = 0;     // of the driver
  double step_error = 0.015;       // largest position error of a full step, as a part of the step angle
  double max_step_rate_hz = 0;     // microsteps per second the driver accepts
  double direction_setup_s = 2e-6;  // least time between two opposite pulses
  double max_acceleration = 0;      // rail unit / s^2; limits the motion, moves and stops
  double max_jerk = 0;              // rail unit / s^3; limits moves, stops and each piece of the motion
  double shaft_ratio = 0;           // derived: gear_ratio, or 2 pi / travel_per_revolution

  [[nodiscard]] bool has_winding() const { return rated_current_a > 0; }
  [[nodiscard]] double rotor_teeth() const { return steps_per_revolution / 4.0; }  // N_r
  // Restoring torque of the field per rad of a small lag: N_r tau_hold.
  [[nodiscard]] double stiffness_nmprad() const { return rotor_teeth() * holding_torque_nm; }
  // The same as a generalised force per rail unit.
  [[nodiscard]] double rail_stiffness() const { return stiffness_nmprad() * shaft_ratio * shaft_ratio; }
  [[nodiscard]] double rail_inertia() const { return rotor_inertia_kgm2 * shaft_ratio * shaft_ratio; }  // J_i
  [[nodiscard]] double microsteps_per_rail_unit() const {
    return steps_per_revolution * microsteps * shaft_ratio / (2 * std::numbers::pi);
  }
};

}  // namespace ballast::sim
