// Bounds that follow from a scenario alone.
#pragma once

#include "hal/lcm/messages.h"
#include "sim/scenario/scenario.h"

namespace ballast::soak {

// No stop of all masses takes longer, s, that begins with these rail velocities and accelerations: with its greatest
// jerk j each motor brings its acceleration a to 0 in |a| / j, which adds at most a^2 / (2 j) to its speed v, and takes
// that speed off from rest to rest of the acceleration, which takes 2 sqrt(v / j), or v / a_max + a_max / j where it
// reaches a_max. The masses stop in the time that the slowest of them needs.
[[nodiscard]] double longest_stop_s(const sim::Scenario& scenario, const double* velocity, const double* acceleration);

// Whether the steps that the controller says it cannot make are beyond what the scenario allows, and what the commanded
// masses can need in that tick. `status` is of the tick before: its next_velocity changes by the motor's acceleration
// at most. Each burst has a pulse at least, and the count takes one more pulse for the position between two microsteps.
// Pulses are closer together than at the greatest speed only where a mass turns.
[[nodiscard]] bool overload_possible(const sim::Scenario& scenario, const controller_status_t& status);

// The difference of two forces on the ball by which plant and controller may not differ, N: 5 % of the weight, or of
// the constant force where nothing weighs; infinity without both (tools/docs/physics.md, section 5).
[[nodiscard]] double disagreement_limit_n(const sim::Scenario& scenario);

// The difference of N or f_s of two derivations of the same state, N. Each sums forces on all masses, with c_i the
// acceleration of mass i without the ball's, and solves three equations for the ball's acceleration. 1e-16 of a term
// per rounding, some hundred roundings, and a condition of the equations of up to 1e4 (a heavy mass near the contact
// point) make 1e-10 of the greatest force; ten times that is allowed.
[[nodiscard]] double rounding_n(const sim::Scenario& scenario, double normal_n, double friction_n,
                                const double* velocity, const double* acceleration);

}  // namespace ballast::soak
