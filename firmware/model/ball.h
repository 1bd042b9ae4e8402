// Input and output of the model: the ball, its masses and the contact forces. Types only.
#pragma once

#include <cmath>

#include "firmware/model/rail.h"

namespace ballast::firmware {

// Parameters of the robot. Symbols: physics.md section 1.
struct BallParams {
  Real radius_m = 0;                             // r > 0
  Real gravity_mps2 = 0;                         // g >= 0
  Real shell_mass_kg = 0;                        // m_0 > 0
  Vector3 inertia_kgm2 = Vector3::Zero();        // diag(I), about m_0's own centre of mass, body frame
  Vector3 center_of_mass_B_m = Vector3::Zero();  // chi_0, from the geometric centre
  Vector3 external_force_W_n = Vector3::Zero();  // F_e, constant, at the geometric centre, space frame
  Vector3 down_W = Vector3(0, 0, -1);            // g_W / g: unit, (0, 0, -1) on a level floor; e3 is the floor's normal
  Real rolling_resistance = 0;                   // c_rr >= 0
  Real spin_friction_m = 0;                      // c_spin >= 0
  Real creep_radps = 0;                          // omega_c >= 0; > 0 where the floor resists
  int mass_count = 0;                            // n, 0..kMaxMasses
  PerMass<Real> mass_kg{};                       // m_i > 0
  PerMass<Rail> rail{};
};

// Rail coordinates and their first two time derivatives (rad or m, per s, per s^2).
struct MassMotion {
  PerMass<Real> position{};
  PerMass<Real> velocity{};
  PerMass<Real> acceleration{};
};

// sqrt(r / g), in which the ball's motion changes; without gravity 1 s.
inline Real unit_s(const BallParams& ball) {
  return ball.gravity_mps2 > 0 ? std::sqrt(ball.radius_m / ball.gravity_mps2) : Real(1);
}

struct RollingForces {
  Vector3 angular_acceleration_B_radps2 = Vector3::Zero();
  Real normal_force_n = 0;                       // N, positive upward
  Vector2 friction_force_W_n = Vector2::Zero();  // force of the surface on the ball, -f_s sigma, space frame
  Real static_friction_n = 0;                    // f_s
};

}  // namespace ballast::firmware
