// Reads a task: a scenario with [task] and without motion. Keys: tools/docs/plan.md.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/plan/problem.h"

namespace ballast::plan {

struct TaskFile {
  sim::Scenario scenario;  // as it is believed, without motion; its duration is the task's
  Task task;
};

// Every error of scenario and task is added to `errors`, in the order of the file; then there is no value.
[[nodiscard]] std::optional<TaskFile> read_task(const std::filesystem::path& file,
                                                std::vector<sim::ScenarioError>& errors);
[[nodiscard]] std::optional<TaskFile> parse_task(const std::string& toml, const std::string& source,
                                                 std::vector<sim::ScenarioError>& errors);

// The problem that the planner solves, from what the task believes of the robot.
[[nodiscard]] Problem make_problem(const TaskFile& file);

}  // namespace ballast::plan
