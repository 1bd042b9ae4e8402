// The disk that rolls without slipping. This room holds the closed forms of the paper that the controller does not use:
// the disk here, masses on any trajectories in trajectories.h, ball and disk in the air in detached.h. They extend the
// firmware's model (firmware/model/rolling.h), take its parameters, and serve tests as a derivation independent of the
// plant.
//
// The disk is the ball whose masses, centre of mass and external force stay in the plane e1-e3, with E2 a principal
// axis orthogonal to it, and that rolls on a level floor without resistance.
//
// phi is the angle from e1 to E1, counterclockwise seen with e2 directed into the page, so a disk with phidot > 0 rolls
// towards -e1. The ball in the same state (paper, app_disk):
//   Lambda = [cos phi 0 -sin phi; 0 1 0; sin phi 0 cos phi]: minus phi about e2, q = (cos phi/2, 0, -sin phi/2, 0),
//   Gamma = (sin phi, 0, cos phi), Omega = -phidot e2, zdot_GC = -r phidot e1 while rolling.
#pragma once

#include "firmware/model/rolling.h"
#include "sim/closed_forms/complex_step.h"

namespace ballast::closed_forms {

using firmware::BallParams;
using firmware::Quaternion;
using firmware::Vector3;

struct DiskState {
  Real angle_rad = 0;               // phi
  Real angular_velocity_radps = 0;  // phidot
};

struct RollingDiskForces {
  Real angular_acceleration_radps2 = 0;  // phiddot
  Real normal_force_n = 0;               // N, positive upward
  Real friction_force_W1_n = 0;          // force of the surface on the disk along e1, the paper's pi f_s
  Real static_friction_n = 0;            // f_s
};

// The ball's attitude and angular velocity Omega in this state.
Quaternion orientation_of(const DiskState& disk);
Vector3 angular_velocity_of(const DiskState& disk);  // body frame, rad/s

// phiddot (eq_ddphi_disk with eq_K_i), N (eq_normal_disk) and -f_s sigma (eq_static_friction_disk). With mass_count = 0
// these are eq_ddphi_sdisk, eq_normal_sdisk and eq_static_friction_sdisk. The inertia enters by d_2 alone and vectors
// by their components 1 and 3; the caller ensures that rails, chi_0 and F_e have no component 2. Deviation from the
// paper: none. Never fails for validated parameters; NaN in gives NaN out.
RollingDiskForces rolling_disk_forces(const BallParams& ball, const DiskState& disk, const MassMotion& masses);
// Own columns: phi and phidot. That of f_s is NaN where f_s = 0.
Derivative<RollingDiskForces> rolling_disk_forces_derivative(const BallParams& ball, const DiskState& disk,
                                                             const MassMotion& masses);

}  // namespace ballast::closed_forms
