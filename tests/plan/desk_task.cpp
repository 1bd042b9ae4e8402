#include "tests/plan/desk_task.h"

#include <gtest/gtest.h>

namespace ballast::plan {

std::string desk_task(const std::string& surface, const std::string& task) {
  return R"(name = "test"
gravity = 9.81
[ball]
radius = 0.15
mass = 0.8
inertia = [0.0118, 0.0118, 0.0118]
[surface]
)" + surface +
         R"([[mass]]
mass = 0.28
rail = { shape = "circle", radius = 0.095, center = [0, -0.06, 0], axes = [[0, 0, -1], [1, 0, 0]] }
[[mass]]
mass = 0.28
rail = { shape = "circle", radius = 0.095, center = [0, 0.06, 0], axes = [[0, 0, -1], [1, 0, 0]] }
[[mass]]
mass = 0.28
rail = { shape = "circle", radius = 0.05, center = [0, 0, 0.03], axes = [[0, 0, -1], [0, 1, 0]] }
[run]
actuation = "prescribed"
[task]
)" + task;
}

std::string errors_of(const std::string& toml) {
  std::vector<sim::ScenarioError> errors;
  static_cast<void>(parse_task(toml, "task.toml", errors));
  std::string text;
  for (const auto& error : errors) text += sim::to_string(error) + "\n";
  return text;
}

namespace {

std::optional<TaskFile> read(const std::string& toml) {
  std::vector<sim::ScenarioError> errors;
  auto task = parse_task(toml, "task.toml", errors);
  EXPECT_TRUE(task) << errors_of(toml);
  return task;
}

}  // namespace

TaskFile read_task(const std::string& toml) { return read(toml).value_or(TaskFile{}); }

Outcome outcome_of(const std::string& toml, Problem& problem) {
  const auto task = read(toml);
  if (!task) return {};
  problem = make_problem(*task);
  return search(problem, task->scenario, {});
}

Outcome outcome_of(const std::string& toml) {
  Problem problem;
  return outcome_of(toml, problem);
}

}  // namespace ballast::plan
