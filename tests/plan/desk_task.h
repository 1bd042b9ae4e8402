// Tasks of a robot like desk_ball, for the tests of the planner.
#pragma once

#include <string>

#include "tools/plan/read_task.h"
#include "tools/plan/search.h"

namespace ballast::plan {

// The robot with prescribed masses. `surface`: lines of [surface], then further tables; `task`: lines of [task].
[[nodiscard]] std::string desk_task(const std::string& surface, const std::string& task);

// Every error of a task file, a line each; empty if it is good.
[[nodiscard]] std::string errors_of(const std::string& toml);

// Reads a task file; a wrong one fails the test.
[[nodiscard]] TaskFile read_task(const std::string& toml);

// Reads and plans; with the problem, for its limits.
[[nodiscard]] Outcome outcome_of(const std::string& toml);
[[nodiscard]] Outcome outcome_of(const std::string& toml, Problem& problem);

}  // namespace ballast::plan
