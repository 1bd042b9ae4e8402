// What can be had where no plan is found: a longer time, a nearer place, a rougher floor. Each is found by a search,
// and a plan that the plant has rolled stands behind it. None is a bound.
#pragma once

#include <optional>
#include <string>

#include "tools/plan/read_task.h"
#include "tools/plan/search.h"

namespace ballast::plan {

struct Alternatives {
  // The shortest duration with a plan to the goal, within 3 % of one without; at most 4 times the task's.
  std::optional<double> duration_s;
  // The place nearest to the goal with a plan in the task's duration, on the straight line from the start, within 3 %
  // of the distance. None for tasks with via places or a path.
  std::optional<Eigen::Vector2d> goal_m;
  // mu_s of a floor that holds a plan for the task. Searched for only where friction alone stands in the way.
  std::optional<double> static_friction;
};

// Searches for alternatives to a task for which `failed` is the outcome. Takes seed, stop and progress from `options`;
// after a stop, what has been found by then is returned. Objective "friction" is planned throughout, since any plan
// that holds will do.
[[nodiscard]] Alternatives find_alternatives(const TaskFile& task, const Outcome& failed, const SearchOptions& options);

// The alternatives in words, to be appended to Outcome::binding. Empty: none.
[[nodiscard]] std::string alternatives_text(const TaskFile& task, const Alternatives& alternatives);

}  // namespace ballast::plan
