// Correlated values of a sweep: a Gaussian copula. The normal numbers behind the values have the correlations asked
// for; every value keeps its own distribution.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "tools/sweep/spec.h"

namespace ballast::sweep {

// Fills spec.copula from spec.correlations, whose keys are varied. Empty, or why no numbers have these correlations.
[[nodiscard]] std::string factor_correlations(Spec& spec);

// Correlates uniform numbers in (0, 1), one per Spec::vary. The others stay as they are, and so does the first key of
// spec.copula up to rounding.
void correlate(const Copula& copula, std::span<double> uniform);

}  // namespace ballast::sweep
