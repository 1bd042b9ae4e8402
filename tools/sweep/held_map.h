// The map of a sweep: the share of the runs that hold over two varied keys, as JSON that `ballast-sweep-map` draws.
#pragma once

#include <string>
#include <utility>

#include "tools/sweep/spec.h"

namespace ballast::sweep {

// The keys of "X,Y"; empty: `why` says what is allowed. Both are varied with numbers.
[[nodiscard]] std::pair<std::string, std::string> map_keys(const Spec& spec, const std::string& text, std::string& why);

// Counts runs and those that hold in the cells of a map: at the values of a grid or choice, otherwise in parts of equal
// size of the key's range (of its logarithm for log_uniform; of mean +- 3 deviations for normal, runs outside are left
// out). Reads the results once, with memory that does not depend on the number of rows. Empty: `error` says why.
[[nodiscard]] std::string held_map_json(const std::string& results_file, const Spec& spec,
                                        const std::pair<std::string, std::string>& keys, std::string& error);

}  // namespace ballast::sweep
