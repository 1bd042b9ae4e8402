#include "tools/soak/failure_table.h"

#include <fmt/core.h>

#include <algorithm>
#include <vector>

#include "tools/soak/random_faults.h"

namespace ballast::soak {

namespace {

// Words with their counts, the most frequent first: "monitor: missing 12, nobody 3".
std::string counted(const std::map<std::string, std::int64_t>& counts) {
  std::vector<std::pair<std::string, std::int64_t>> sorted(counts.begin(), counts.end());
  std::ranges::stable_sort(sorted, [](const auto& a, const auto& b) { return a.second > b.second; });
  std::string text;
  for (const auto& [word, count] : sorted) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", word, count);
  return text;
}

}  // namespace

void FailureTable::add(const SeedResult& result) {
  if (result.fault_kind < 0) return;
  Row& row = rows_[{result.fault_kind, result.severity}];
  ++row.runs;
  row.violated += result.violated;
  ++row.outcomes[static_cast<std::size_t>(result.outcome)];
  ++row.detected_by[result.detected_by];
  if (!result.detected) return;
  row.least_ticks = row.detected == 0 ? result.detected_after : std::min(row.least_ticks, result.detected_after);
  row.most_ticks = row.detected == 0 ? result.detected_after : std::max(row.most_ticks, result.detected_after);
  ++row.detected;
}

std::string FailureTable::markdown() const {
  std::string text =
      "| fault | severity | runs | detected by | after ticks | left the envelope | outcome "
      "|\n|---|---|---|---|---|---|---|\n";
  for (const auto& [key, row] : rows_) {
    const auto kind = static_cast<sim::FaultKind>(key.first);
    std::map<std::string, std::int64_t> outcomes;
    for (std::size_t i = 0; i < row.outcomes.size(); ++i) {
      if (row.outcomes[i] > 0) outcomes[to_string(static_cast<Outcome>(i))] = row.outcomes[i];
    }
    std::string ticks = "-";
    if (row.detected > 0) ticks = fmt::format("{}", row.least_ticks);
    if (row.most_ticks > row.least_ticks) ticks += fmt::format(" to {}", row.most_ticks);
    text +=
        fmt::format("| `{}` | {} | {} | {} | {} | {} | {} |\n", sim::info(kind).name, severity_text(kind, key.second),
                    row.runs, counted(row.detected_by), ticks, row.violated, counted(outcomes));
  }
  return text;
}

}  // namespace ballast::soak
