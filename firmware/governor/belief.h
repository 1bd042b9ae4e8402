// How far a robot that is not quite as believed leaves the path of a rollout, and what that adds to its friction.
//
// Masses, moments of inertia and the shell's centre of mass may be off by declared bounds. Each of these errors changes
// Omegadot and the force at a state, and along a rollout it leads the ball astray: a tilt e and an angular velocity v,
// seen from those that are predicted, horizontal in the space frame, with e' = v + omega_3 e3 x e and v' = stiffness e +
// push.
//
// Invariants: fixed size, no heap. The same bits on every processor: of libm sqrt only.
//
// Source: our derivation, tools/docs/governor.md, "Belief".
#pragma once

#include "firmware/governor/governor_params.h"
#include "firmware/governor/held_ball.h"

namespace ballast::firmware {

// Errors: of the shell's centre of mass along the body's axes, of its inertia about them, of its mass, and of each
// mass.
inline constexpr int kFirstInertiaError = 3, kShellMassError = 6, kShellErrors = 7;
inline constexpr std::size_t kMostErrors = kShellErrors + kMaxMasses;
template <class T>
using PerError = std::array<T, kMostErrors>;

// A horizontal vector, space frame.
struct Horizontal {
  Real x = 0, y = 0;
};

// The masses seen from the centre of mass.
struct Arms {
  Real mass_kg = 0;                      // M
  Vector3 center_B_m = Vector3::Zero();  // the centre of mass from the geometric centre
  Vector3 shell_B_m = Vector3::Zero();   // the shell's centre of mass, from there
  PerMass<Vector3> arm_B_m;              // of each mass, from there
  // The part of each mass's acceleration that the body's does not have: zeta' u + 2 Omega x zeta' v + zeta'' v^2.
  PerMass<Vector3> own_B_mps2;
};

// `masses`: with their accelerations.
[[nodiscard]] Arms arms_of(const BallParams& ball, const MassMotion& masses, const Vector3& angular_velocity_B_radps);

// At one state.
struct Drift {
  int errors = 0;
  Real spin_radps = 0;                   // omega_3
  Real stiffness_per_s2 = 0;             // > 0: the ball falls over
  PerError<Horizontal> pushes_radps2{};  // what each error adds to the angular acceleration
  Real off_center_m = 0;                 // bound of the error of the centre of mass
  // In N: what all errors may add to f_s - q N, q = f_s / N, beside their angular accelerations; and per unit of those,
  // of angular velocity and of tilt.
  Real other_n = 0, per_angular_acceleration = 0, per_omega = 0, per_tilt = 0;
  // A floor that resists turns its moment with omega: this much, where the errors of omega reach `rolling_radps`.
  Real resistance_n = 0, rolling_radps = 0;

  // All errors add at most this to f_s - q N at this state.
  [[nodiscard]] Real force_n() const;
};

void drift_of(const BallParams& ball, const BeliefErrors& errors, const Arms& arms, const Quaternion& orientation,
              const Vector3& angular_velocity_B_radps, const RollingForces& forces, Drift& out);

// How far astray each error leads the ball.
class Astray {
 public:
  // After another step of h.
  void advance(const Drift& drift, Real h_s);

  // Bounds of the angular velocity's and the tilt's errors.
  [[nodiscard]] Real omega_radps(const Drift& drift) const;
  [[nodiscard]] Real tilt_rad(const Drift& drift) const;
  // All errors together add at most this to f_s - q N there.
  [[nodiscard]] Real force_n(const Drift& drift) const;

 private:
  PerError<Horizontal> tilt_{}, omega_{};
};

// Bounds of a ball that is held where errors have led it astray.
[[nodiscard]] HeldErrors held_errors(const BallParams& ball, const BeliefErrors& errors, const Arms& arms,
                                     const Drift& drift, const Astray& astray);

}  // namespace ballast::firmware
