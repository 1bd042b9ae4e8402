// The values of a run that a sweep keeps, by their dotted names in summary.json.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "tools/sil/run.h"
#include "tools/sweep/cell.h"

namespace ballast::sweep {

// Empty, or why the name is none of a value in summary.json, with the nearest name. Lists of tables are taken entry by
// entry: "motors.0.lost_steps".
[[nodiscard]] std::string unknown_value(const std::string& name);

// One cell per name. A value that this run does not have is empty. mu_required.max is infinite where N fell to 0.
[[nodiscard]] std::vector<Cell> kept_values(std::span<const std::string> names, const sim::Scenario& scenario,
                                            const sil::RunResult& result);
// The same where decided_by_plant(); of the result only what the plant decides is read.
[[nodiscard]] std::vector<Cell> kept_plant_values(std::span<const std::string> names, const sim::Scenario& scenario,
                                                  const sil::RunResult& result);

// Whether the plant alone decides all of these values, so that a prescribed run needs no ticks. Without a [plan], such
// a run has no values of feedback.
[[nodiscard]] bool decided_by_plant(std::span<const std::string> names, bool has_plan);

}  // namespace ballast::sweep
