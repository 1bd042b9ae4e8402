// Projects rail accelerations into the friction cone: the nearest u for which the ball neither slips nor lifts off.
//
// At one state the contact force is affine in u (model/affine_forces.h). The cone |f| <= friction N - slack_n and the
// box lower <= u <= upper are convex, so the nearest u is unique.
//
// Invariants: fixed size, at most 6 kMostConeSteps + 24 half spaces with at most mass_count + 1 steps each. The same
// bits on every processor: of libm sqrt only.
//
// Source: our derivation, tools/docs/governor.md, "Cone".
#pragma once

#include <limits>

#include "firmware/model/affine_forces.h"

namespace ballast::firmware {

inline constexpr int kMostConeSteps = 32;

struct Cone {
  Real friction = 0;            // kappa > 0: f_s <= kappa N. Infinite: only N is limited
  Real min_normal_force_n = 0;  // N >= this, >= 0
  Real slack_n = 0;             // >= 0: f_s <= kappa N - slack_n
  // Each mass accelerates by up to this more or less than u says, >= 0. With e the direction of the friction the slack
  // grows by sum error_i |e . F_i - kappa n_i|, F_i and n_i the columns of friction and N: what the errors may add to
  // f_s - kappa N, to first order.
  PerMass<Real> error{};
};

// Bounds of u in rail units / s^2, lower <= upper.
struct Box {
  PerMass<Real> lower{};
  PerMass<Real> upper{};
};

struct Projection {
  PerMass<Real> u{};
  bool bent = false;     // u is not the nominal
  bool empty = false;    // no u of the box lies in the cone; u has the least violation that was found
  Real violation_n = 0;  // how far the force is outside of the cone, > 0 only where it is empty
  int steps = 0;         // of the search for a direction, each at most mass_count + 1 steps of Newton's method
};

// How far the force of u is outside of the cone, in N; <= 0: inside.
[[nodiscard]] Real outside_n(const Cone& cone, const AffineForces& forces, int mass_count, const PerMass<Real>& u);

// Errors of the accelerations add at most this to f_s - kappa N. They also turn the friction, so where it is
// small beside them this is more than what they add along it.
[[nodiscard]] Real errors_n(const Cone& cone, const AffineForces& forces, int mass_count, const PerMass<Real>& u);

// The same as outside_n() with all that the errors may add: `added_n`, the errors_n() of u.
[[nodiscard]] Real most_outside_n(const Cone& cone, const AffineForces& forces, int mass_count, const PerMass<Real>& u,
                                  Real added_n);

// The cone whose slack along the friction of u covers all that the errors may add to it: `added_n`, the errors_n() of
// u.
[[nodiscard]] Cone with_turning(const Cone& cone, const AffineForces& forces, int mass_count, const PerMass<Real>& u,
                                Real added_n);

// Minimises sum ((u_i - nominal_i) / unit_i)^2 in box and cone. `unit`: > 0, the size of a change that costs 1, such as
// the greatest acceleration. Where the nominal lies in both it is returned, bit for bit.
//
// f_s and N keep the cone up to kConeTolerance of their sum. Where only N >= min_normal_force_n would be broken, the
// force is projected into the cone with its tip at that N instead, which lies inside of both, and where that fails too,
// from the u with the greatest N. Then u keeps the limits but is not the nearest. NaN in gives empty, with u the
// nominal inside the box.
//
// After `most_steps` no further search begins: where there was none inside up to then, the answer is `empty` although
// there may be one. 0: one search of at most kMostConeSteps half spaces.
[[nodiscard]] Projection project(const AffineForces& forces, int mass_count, const Cone& cone, const Box& box,
                                 const PerMass<Real>& unit, const PerMass<Real>& nominal,
                                 int most_steps = std::numeric_limits<int>::max());

}  // namespace ballast::firmware
