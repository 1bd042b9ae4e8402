// A run's result: summary.json for programs, and a page of text for the terminal.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/sil/run.h"

namespace ballast::sil {

// summary.json, field by field in tools/README.md, ending in a newline. Numbers are written with the digits that give
// back the same double (17 at most). Infinite values (a friction no surface gives, perfect friction) are null.
std::string summary_json(const sim::Scenario& scenario, const RunResult& result);

// belief.csv: what the believed robot would have done, a row per instant from t = 0 on; empty where nothing but the
// truth is believed. Columns time_s, position_1_m, position_2_m, normal_force_n, static_friction_n, mu_required ("inf"
// where N <= 0).
std::string belief_csv(const RunResult& result);

// For the terminal, ending in a newline. `directory` is where the results are.
std::string summary_text(const sim::Scenario& scenario, const RunResult& result,
                         const std::filesystem::path& directory);

// The paper's floors for an aluminium shell (PHYSICS.md section 6), and whether the ball rolls on each. A run in which
// rolling was lost tells this only up to there. Empty if the run did not start rolling.
struct FloorVerdict {
  const char* name;
  double static_friction;
  bool holds;
};
std::vector<FloorVerdict> floor_verdicts(const sim::Scenario& scenario, const RunResult& result);

// The name of trip_t's cause in the summary.
const char* trip_cause(int cause);

// The controller's own reason to trip, where the monitor had none: the first fault in the order of
// firmware/safety/fault.h.
const char* fault_cause(std::int32_t faults);

// The controller tripped by itself, and the monitor later or not at all.
bool controller_tripped_first(const RunResult& result);

// The motors that lost steps, and what to do about it; empty: none.
std::string lost_steps_text(const sim::Scenario& scenario, const RunResult& result);

// Warnings that --quiet does not suppress: lost steps, masses outside the ball, a move that did not arrive.
std::vector<std::string> warnings(const sim::Scenario& scenario, const RunResult& result);

// Whether the move that was asked for has made all its steps and lost none. Every mass is then at its target, but for
// its motor's lag within a tooth.
bool arrived(const RunResult& result);

// 0 inside the envelope, 3 outside or tripped; 2 a move that was inside and did not arrive.
int exit_status(const RunResult& result);

}  // namespace ballast::sil
