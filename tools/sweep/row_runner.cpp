#include "tools/sweep/row_runner.h"

#include <algorithm>

#include "tools/sweep/limit_search.h"

namespace ballast::sweep {

RowRunner::RowRunner(const Spec& spec, const RowScenarios& scenarios)
    : spec_(spec), scenarios_(scenarios), batch_(spec, scenarios) {}

std::vector<RowResult> RowRunner::run_rows(const std::vector<Row>& rows) {
  if (batch_.usable()) return batch_.run(rows);
  std::vector<RowResult> results;
  for (const Row& row : rows) results.push_back(run_row(spec_, scenarios_, row));
  return results;
}

void RowRunner::run(std::uint64_t first, std::uint64_t count, const TakeRow& take) {
  const std::uint64_t at_once = batch_.usable() ? kLanes : 1;
  for (std::uint64_t begin = first; begin < first + count; begin += at_once) {
    std::vector<Row> rows;
    for (std::uint64_t i = begin; i < std::min(begin + at_once, first + count); ++i) rows.push_back(make_row(spec_, i));
    if (beginning_) beginning_(begin, rows.size());
    std::vector<RowResult> results =
        spec_.find_limit.empty() ? run_rows(rows)
                                 : find_limits(spec_, rows, [this](const auto& some) { return run_rows(some); });
    for (RowResult& result : results) {
      if (!take(std::move(result))) return;
    }
  }
}

}  // namespace ballast::sweep
