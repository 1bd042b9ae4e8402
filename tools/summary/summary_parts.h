// Helpers that summary.json and the summary for the terminal share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tools/summary/summary.h"

namespace ballast::sil {

const char* regime_name(sim::Regime regime);

// The mass that an end_switch trip is about, commanded on over an end of its rail; -1 for other trips.
int mass_at_its_end(const ControllerTrip& trip);

inline bool asked(const MoveEnd& move, std::size_t mass) { return (move.asked.masses >> mass & 1u) != 0; }

// This run's value of a published quantity.
double measured(const RunResult& result, const std::string& quantity);

// Sums over the motors of a checked run.
struct CheckedSteps {
  std::int64_t checked = 0, structural = 0;
  double max_error_us = 0, tolerance_us = 0;
};
CheckedSteps checked_steps(const StepTimingRecord& record);

// Lost steps, and masses outside the ball.
std::vector<std::string> warnings_of_masses(const sim::Scenario& scenario, const RunResult& result);

// The final positions of a move's masses: first those asked for, then those that were to hold.
std::string move_end_text(const sim::Scenario& scenario, const RunResult& result);

}  // namespace ballast::sil
