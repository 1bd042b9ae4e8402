// The closed forms for masses on any trajectories, rolling, and the sums that they share with the detached ones.
#pragma once

#include "firmware/model/ball_sums.h"
#include "sim/closed_forms/rolling_disk.h"

namespace ballast::closed_forms {

using firmware::RollingForces;

// chi_i from the geometric centre, and its first two time derivatives as the body frame sees them. Entries from
// mass_count on are not read.
struct MassTrajectories {
  firmware::PerMass<Vector3> position_B_m;
  firmware::PerMass<Vector3> velocity_B_mps;
  firmware::PerMass<Vector3> acceleration_B_mps2;
};

// eq_1d_param: chi_i, chidot_i and chiddot_i of masses on their rails.
MassTrajectories along_rails(const BallParams& ball, const MassMotion& masses);

// The sums of shell and masses with the levers chi_i + `offset`, and u.
firmware::detail::Sums sums_of(const BallParams& ball, const firmware::detail::Vec& omega,
                               const MassTrajectories& masses, const firmware::detail::Vec& offset,
                               const firmware::detail::Vec& u);

// eq_Om, eq_normal and eq_static_friction; ball.rail is not read. Otherwise as firmware::rolling_forces().
RollingForces rolling_forces_3d(const BallParams& ball, const Quaternion& orientation,
                                const Vector3& angular_velocity_B_radps, const MassTrajectories& masses);

}  // namespace ballast::closed_forms
