// A plan as files: the scenario that runs it, and what is claimed of it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "tools/plan/read_task.h"
#include "tools/plan/search.h"

namespace ballast::plan {

[[nodiscard]] const char* to_string(Status status);
[[nodiscard]] const char* to_string(Objective objective);

// The task's scenario with the plan's motion and duration, the name NAME_plan and [plan], which says what is claimed
// and the path as rows of t, x, y and f_s/N. It keeps [task], so that pictures can show goal, via places and obstacles;
// published numbers belong to another motion and are left out. `toml`: the task's file.
[[nodiscard]] std::string plan_toml(const std::string& toml, const TaskFile& task, const Plan& plan);

// The name of the scenario that plan_toml() gives.
[[nodiscard]] std::string plan_name(const std::string& task_name);

// The plan's run with its motors and the firmware: the friction it needed up to its end, and "completed" or why it
// ended.
struct StepperRun {
  sim::Extremum mu_required_max;
  std::string end_reason;
  double end_time_s = 0;
};

// `with_steppers`: null in a task of prescribed masses.
[[nodiscard]] std::string outcome_json(const TaskFile& task, const Outcome& outcome, const StepperRun* with_steppers,
                                       std::uint64_t seed, double wall_time_s);

}  // namespace ballast::plan
