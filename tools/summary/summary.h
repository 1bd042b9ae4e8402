// What a run has shown: summary.json for programs, and a page of words for people.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/sil/run.h"

namespace ballast::sil {

// summary.json, field by field in tools/README.md, ending in a newline. Numbers are written with the digits that give
// back the same double (17 at most); what is infinite (a friction no surface gives, perfect friction) is null.
std::string summary_json(const sim::Scenario& scenario, const RunResult& result);

// For the terminal, ending in a newline. `directory` is where the results are.
std::string summary_text(const sim::Scenario& scenario, const RunResult& result,
                         const std::filesystem::path& directory);

// The paper's floors for an aluminium shell (PHYSICS.md section 6), and whether the ball rolls on each as far as this
// run can tell: up to where rolling was lost. Empty if the run did not start rolling: it says nothing of other floors.
struct FloorVerdict {
  const char* name;
  double static_friction;
  bool holds;
};
std::vector<FloorVerdict> floor_verdicts(const sim::Scenario& scenario, const RunResult& result);

// trip_t's cause, by its name in the summary.
const char* trip_cause(int cause);

// The controller's own reason to trip, where the monitor had none: the first of firmware/safety/fault.h.
const char* fault_cause(std::int32_t faults);

// Which motors lost steps, and what to do about it; empty: none.
std::string lost_steps_text(const sim::Scenario& scenario, const RunResult& result);

// What must not stay unsaid, --quiet or not: lost steps, masses outside the ball, a move that did not arrive.
std::vector<std::string> warnings(const sim::Scenario& scenario, const RunResult& result);

// A move that was asked for: its steps are all made and none was lost, so that every mass is where it was to be, but
// for what its motor lags in its tooth.
bool arrived(const RunResult& result);

// 0 inside the envelope, 3 outside or tripped; 2 a move that was inside and did not arrive.
int exit_status(const RunResult& result);

}  // namespace ballast::sil
