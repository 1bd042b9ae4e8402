// Exact order statistics of more numbers than fit into memory.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

namespace ballast::sweep {

// Calls its argument with every number, in any order; NaN is left out by the callee.
using ForEachNumber = std::function<void(const std::function<void(double)>&)>;

// The values at these ranks (from 0, below the count of numbers that are not NaN) among the sorted numbers. Goes
// through the numbers four times; the memory is 0.5 MB per rank.
[[nodiscard]] std::vector<double> values_at_ranks(const ForEachNumber& for_each,
                                                  const std::vector<std::uint64_t>& ranks);

}  // namespace ballast::sweep
