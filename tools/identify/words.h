// A fit's result, as text and as a belief.
#pragma once

#include <string>

#include "tools/identify/fit.h"

namespace ballast::identify {

// A line for each parameter: believed, identified and the interval; below it what is unknown.
[[nodiscard]] std::string identified_text(const Parameters& parameters, const Known& known, const Identified& fit);

// How residuals above the sensors' noise widen the intervals: "; the residuals have ..".
[[nodiscard]] std::string excess_text(double excess);

// The half-widths of the 95 % intervals, a line for each parameter.
[[nodiscard]] std::string intervals_text(const Parameters& parameters, const Identified& fit);

// A key of control.belief_error: the widest of the 95 % intervals that it bounds.
struct Widest {
  double half_width = 0;  // of masses and moments of inertia as a part of them; infinite: one is unknown
  std::string name;       // of that parameter
  double most = 0;        // that can be declared

  [[nodiscard]] bool can_be_declared() const { return half_width <= most; }
};
struct BeliefError {
  Widest mass, center_of_mass_m;
};
[[nodiscard]] BeliefError belief_error(const Parameters& parameters, const Identified& fit);

// A line for each key: what is declared, or why it is not.
[[nodiscard]] std::string declared_text(const BeliefError& error);

// The scenario's file with a [believed] of what was identified, and belief_error() as control.belief_error where it can
// be declared. Other keys stay. Parameters that are unknown keep what that scenario believes (`known`). `name`: of the
// scenario; empty: it keeps its own.
[[nodiscard]] std::string believed_toml(const std::string& toml, const Parameters& parameters, const Known& known,
                                        const Identified& fit, const std::string& name = "");

}  // namespace ballast::identify
