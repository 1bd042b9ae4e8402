#include "tests/tracking/random_plans.h"

#include <cmath>
#include <vector>

#include "tools/plan/random_task.h"
#include "tools/plan/read_task.h"
#include "tools/plan/search.h"
#include "tools/plan/write_plan.h"

namespace ballast::tracking_test {

std::optional<std::string> random_plan(int robot, std::string& why) {
  // A number whose task is from rest to rest along the driving direction, of a desk-like robot (random_task(),
  // random_robot()). Every seed has another robot there. Its motors are the default ones of a scenario.
  constexpr int kNumber = 101;
  constexpr double kLeastWay = 2;  // radii; 3 degrees at the start alone are 0.05
  const auto task = plan::random_task(static_cast<std::uint64_t>(robot) + 1, kNumber, why);
  if (!task) return std::nullopt;
  std::vector<sim::ScenarioError> errors;
  const auto file = plan::parse_task(*task, "random task", errors);
  if (!file) {
    why = sim::to_string(errors.front());
    return std::nullopt;
  }
  const double way = (file->task.goal_m - file->scenario.initial.position_W_m).norm() / file->scenario.ball.radius_m;
  if (way < kLeastWay) {
    why = "its goal is near";
    return std::nullopt;
  }
  // The first plan that holds will do, and a robot for which that takes long is passed over.
  bool found = false;
  plan::SearchOptions options;
  options.most_iterations = 200;
  options.progress = [&](int, double best, double, double) { found = std::isfinite(best); };
  options.stop = [&] { return found; };
  const plan::Outcome outcome = plan::search(plan::make_problem(*file), file->scenario, options);
  if (outcome.plan) return plan::plan_toml(*task, *file, *outcome.plan);
  why = outcome.binding;
  return std::nullopt;
}

}  // namespace ballast::tracking_test
