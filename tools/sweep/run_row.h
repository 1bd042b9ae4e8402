// The run of one row, in this process, without a log.
#pragma once

#include <string>
#include <vector>

#include "tools/sil/run.h"
#include "tools/sweep/cell.h"
#include "tools/sweep/row_scenario.h"

namespace ballast::sweep {

struct RowResult {
  std::uint64_t number = 0, seed = 0;
  int exit_status = 0;       // as `ballast run` would return; 1: the scenario's check refuses the row's values
  std::vector<Cell> varied;  // one per Spec::vary
  std::vector<Cell> kept;    // one per Spec::keep; empty cells where there was no run to its end

  [[nodiscard]] bool held() const { return exit_status == 0; }
};

// Whether a run needs no ticks: it is prescribed, rolls until it ends, and keeps only what the plant decides.
[[nodiscard]] bool plant_suffices(const Spec& spec, const RowScenarios& scenarios, const sim::Scenario& scenario);
// Such a run: the plant goes to the end at once. Its extrema are those of all instants, so they tell whether the
// monitor would have tripped.
[[nodiscard]] sil::RunResult run_plant(const sim::Scenario& scenario);

// `why`, if given, gets the reason of exit status 1 or 2.
[[nodiscard]] RowResult run_row(const Spec& spec, const RowScenarios& scenarios, const Row& row,
                                std::string* why = nullptr);

}  // namespace ballast::sweep
