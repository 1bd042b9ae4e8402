// Alternatives where no plan is found: a longer time, a nearer place, a rougher floor. Each is found by a search,
// and a plan that the plant has rolled stands behind it. None is a bound.
#pragma once

#include <functional>
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

// Called from time to time with what is being looked for: "a longer duration: 4.2 s".
using LookingFor = std::function<void(const std::string& what)>;

// Searches for alternatives to a task for which `failed` is the outcome. Takes seed, stop and stepper_need from
// `options`; after a stop, alternatives found by then are returned. Duration and goal are looked for with the objective
// "friction", and those named are then found for the task's own objective.
[[nodiscard]] Alternatives find_alternatives(const TaskFile& task, const Outcome& failed, const SearchOptions& options,
                                             const LookingFor& looking_for);

// The alternatives in words, to be appended to Outcome::binding. Empty: none.
[[nodiscard]] std::string alternatives_text(const TaskFile& task, const Alternatives& alternatives);

}  // namespace ballast::plan
