// The contact laws of physics.md section 4: Coulomb's friction and Newton's restitution at one point. Space frame, the
// third axis up.
//
// All laws concern one linear relation between the force R at the contact and its effect,
//   y = free + C R,   C symmetric positive definite for impulses.
// For forces the moment of a floor that resists adds to C's third column; what is left of the laws then is stated where
// it matters, as normal_coefficient().
// Either y is the rate of the slip velocity and R a force (newton_euler.h), or y is the slip velocity after an impact
// and R an impulse. The laws make the third entry of y 0; a caller who wants another value subtracts it from `free`.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

namespace ballast::sim {

struct ContactRelation {
  Eigen::Vector3d free;
  Eigen::Matrix3d compliance;  // C
};

// N's coefficient in the normal equation of sliding along the unit vector e, n . C (n - mu e). Where it is not
// positive, pressing the ball into the floor no longer pushes it out (Painleve), and sliding has no solution.
double normal_coefficient(const ContactRelation& contact, double kinetic_friction, const Eigen::Vector2d& e);

// R = N (n - mu_k e) with y_3 = 0. N may be negative: the floor would have to pull. The coefficient must be positive.
Eigen::Vector3d sliding_force(const ContactRelation& contact, double kinetic_friction, const Eigen::Vector2d& e);

// The direction in which slip begins, or in which the slip after an impact points: the unit vector e whose sliding
// force makes the horizontal part of y point along e. Returns the one nearest to `towards` if there are several, and
// none if there is none with N > 0. Values below `negligible` are rounding.
std::optional<Eigen::Vector2d> slip_direction(const ContactRelation& contact, double kinetic_friction,
                                              const Eigen::Vector2d& towards, double negligible);

// The same for a contact that has changed a little since its direction was `from`.
Eigen::Vector2d follow_slip_direction(const ContactRelation& contact, double kinetic_friction,
                                      const Eigen::Vector2d& from);

struct ImpactImpulse {
  Eigen::Vector3d impulse_W_ns;
  bool sticking;
  Eigen::Vector2d slip_W_mps;  // after it; 0 if sticking
};

// One impulse at a contact point that arrives with the slip velocity `before_W_mps` (third entry < 0) and is to leave
// at leaving_mps >= 0 along the normal. It sticks if |P_t| <= mu_s P_n; else |P_t| = mu_k P_n against the slip after
// it. (If the ball's centre of mass is its geometric centre, the slip before has the same direction.) None: no impulse
// obeys the laws; `why` explains.
std::optional<ImpactImpulse> impact_impulse(const Eigen::Vector3d& before_W_mps, const Eigen::Matrix3d& compliance,
                                            double static_friction, double kinetic_friction, double leaving_mps,
                                            std::string& why);

}  // namespace ballast::sim
