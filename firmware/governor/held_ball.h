// The ball with all masses held on their rails: a rigid body that rolls.
//
// Its sums over the masses are constants of the body frame, so an evaluation costs about a fifth of rolling_forces().
// On a level floor its energy is constant or falls, and a bound on the energy bounds f_s / N for ever.
//
// Source: our derivation, tools/docs/governor.md, "Held for ever".
#pragma once

#include "firmware/governor/robot_state.h"

namespace ballast::firmware {

struct HeldBall {
  Real mass_kg = 0;                         // M
  Vector3 moment_B_kgm = Vector3::Zero();   // sum m_i zeta_i, shell included
  Matrix3 second_B_kgm2 = Matrix3::Zero();  // sum m_i zeta_i zeta_i^T
};

[[nodiscard]] HeldBall hold_masses(const BallParams& ball, const PerMass<Real>& mass_position);

// Equals rolling_forces() for masses at rest on their rails.
[[nodiscard]] RollingForces held_forces(const BallParams& ball, const HeldBall& held, const Quaternion& orientation,
                                        const Vector3& angular_velocity_B_radps);

// Bound of the contact point's demands for all time.
struct ForEver {
  bool known = false;          // level floor, no external force
  Real acceleration_mps2 = 0;  // the centre of mass never accelerates more
};

// How far the true ball may be from the believed one, of any sign.
struct HeldErrors {
  Real mass_share = 0;    // every mass and moment of inertia, as a part of it
  Real off_center_m = 0;  // the centre of mass
  Real turns_kgm2 = 0;    // the moments of inertia about it, by where the shell's centre of mass is
  Real omega_radps = 0;   // angular velocity, space frame
  Real tilt_rad = 0;

  [[nodiscard]] bool any() const { return mass_share > 0 || off_center_m > 0 || omega_radps > 0 || tilt_rad > 0; }
};

// Held from this state on.
[[nodiscard]] ForEver held_for_ever(const BallParams& ball, const HeldBall& held, const Quaternion& orientation,
                                    const Vector3& angular_velocity_B_radps, const HeldErrors& errors = {});

// f_s / (friction N) of a ball whose centre of mass accelerates by at most acceleration_mps2, whatever its direction;
// infinite where N could fall to min_normal_force_n.
[[nodiscard]] Real greatest_use(const BallParams& ball, Real mass_kg, Real acceleration_mps2, Real friction,
                                Real min_normal_force_n);

// Moves attitude, angular velocity and place of a ball with held masses by h, by the classic Runge-Kutta rule.
// `start` are the forces at its beginning.
void step_held(const BallParams& ball, const HeldBall& held, const RollingForces& start, Real h_s, RobotState& state);

}  // namespace ballast::firmware
