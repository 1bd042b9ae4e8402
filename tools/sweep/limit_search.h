// --find-limit: the boundary between the values of one key with which a run holds and those with which it does not,
// for each row of the other keys, by bisection of the key's range.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tools/sweep/run_row.h"

namespace ballast::sweep {

// The bracket of the limit is halved this often: to a 65,536th of the range (of its logarithm for log_uniform).
inline constexpr int kLimitHalvings = 16;

// Columns that a search adds to the kept values: the middle of the last bracket, NaN if there is none; and what holds.
inline constexpr const char* kLimitColumn = "limit";
inline constexpr const char* kLimitKindColumn = "limit_kind";

// Why no limit of this key can be searched; empty: it can. The key is varied with uniform or log_uniform, which is the
// range of the search.
[[nodiscard]] std::string limit_refusal(const Spec& spec, const std::string& key);

// Runs the rows it is given, in their order.
using RunRows = std::function<std::vector<RowResult>(const std::vector<Row>& rows)>;

// One result per row. It is that of the run with the last value of the key that holds, or with the low end where no
// value does, and two cells more for the columns above. A row that is refused or fails at one value has that result,
// without a limit.
[[nodiscard]] std::vector<RowResult> find_limits(const Spec& spec, const std::vector<Row>& rows,
                                                 const RunRows& run_rows);

}  // namespace ballast::sweep
