// A fit's result, as text and as a belief.
#pragma once

#include <string>

#include "tools/identify/fit.h"

namespace ballast::identify {

// A line for each parameter: believed, identified and the interval; below it what is unknown.
[[nodiscard]] std::string identified_text(const Parameters& parameters, const Known& known, const Identified& fit);

// The half-widths of the 95 % intervals, a line for each parameter.
[[nodiscard]] std::string intervals_text(const Parameters& parameters, const Identified& fit);

// Greatest half-widths of the 95 % intervals: of masses and moments of inertia as parts of them, and of the components
// of the centre of mass. Infinite where one of them is unknown.
struct BeliefError {
  double mass_share = 0, center_of_mass_m = 0;
};
[[nodiscard]] BeliefError belief_error(const Parameters& parameters, const Identified& fit);

// The scenario's file with a [believed] of what was identified, and belief_error() as control.belief_error where it is
// known. Other keys stay. Parameters that are unknown keep what is believed.
[[nodiscard]] std::string believed_toml(const std::string& toml, const Parameters& parameters, const Known& known,
                                        const Identified& fit);

}  // namespace ballast::identify
