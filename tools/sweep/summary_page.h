// The summary of a sweep's results, for people.
#pragma once

#include <string>

#include "tools/sweep/spec.h"

namespace ballast::sweep {

// Shares of the runs that held and of their ends with Wilson intervals, quantiles of the numbers with intervals from
// order statistics, the first run that was refused. Intervals are left out where nothing varies at random. Reads the
// file a few times, with memory that does not depend on the number of rows. Empty: `error` says what could not be read.
[[nodiscard]] std::string summary_page(const std::string& results_file, const Spec& spec, std::string& error);

// The share of the runs that hold, and the worst one, in one sentence without a full stop.
[[nodiscard]] std::string robustness_sentence(const std::string& results_file, const Spec& spec, std::string& error);

}  // namespace ballast::sweep
