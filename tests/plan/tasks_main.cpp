// plan_tasks [FIRST [COUNT [SEED]]]: plans random tasks, checks each plan with the plant, and prints what was found.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

#include "tools/plan/random_task.h"
#include "tools/plan/write_plan.h"

namespace {

using namespace ballast;

double cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// The claim against a run of the file as it would be written. Returns an error in words, or nothing.
std::string check(const std::string& toml, const plan::TaskFile& task, const plan::Outcome& outcome) {
  const auto read = sim::parse_scenario(plan::plan_toml(toml, task, *outcome.plan), "plan");
  if (!read.ok()) return sim::to_string(read.errors.front());
  sim::Scenario scenario = read.scenario;
  scenario.run.actuation = sim::Actuation::kPrescribed;
  sim::Plant plant(scenario);
  plant.advance(scenario.duration_s, {});
  if (plant.end() != sim::PhysicsEnd::kNone) return "does not roll to its end";
  const double claimed = outcome.plan->run.extrema.mu_required_max.value,
               rolled = plant.extrema().mu_required_max.value;
  if (std::abs(claimed - rolled) > 1e-4 * rolled) return fmt::format("claims {} and needs {}", claimed, rolled);
  const Eigen::Vector2d end = plant.sample().position_W_m.head<2>();
  if ((end - task.task.goal_m).norm() > 1e-3) return fmt::format("misses by {} m", (end - task.task.goal_m).norm());
  return "";
}

// What the task asks for.
std::string words_of(const plan::TaskFile& file) {
  const plan::Task& task = file.task;
  std::string text = fmt::format("{} masses, {}", file.scenario.masses.size(), plan::to_string(task.objective));
  if (file.scenario.run.actuation == sim::Actuation::kStepper) text += ", steppers";
  if (task.at_rest) text += ", rest";
  if (!task.via.empty()) text += ", via";
  if (!task.keep_out.empty()) text += ", obstacle";
  if (task.follow) text += ", path";
  if (!task.mass_position.empty()) text += ", mass positions";
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  const auto number_at = [&](int i, int otherwise) {
    return i < argc ? static_cast<int>(std::strtol(argv[i], nullptr, 10)) : otherwise;
  };
  const int first = number_at(1, 0), count = number_at(2, 50);
  const std::uint64_t seed = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1;
  std::setvbuf(stdout, nullptr, _IOLBF, 1 << 12);  // shows the tasks as they are done
  int found = 0, wrong = 0, sure = 0, sure_found = 0;
  std::vector<double> seconds;
  for (int number = first; number < first + count; ++number) {
    std::string why;
    const std::string toml = plan::random_task(seed, number, why).value_or("");
    std::vector<sim::ScenarioError> errors;
    const auto task = plan::parse_task(toml, "task", errors);
    if (!task) {
      fmt::print("{}: no task: {}\n", number, why.empty() ? sim::to_string(errors.front()) : why);
      ++wrong;
      continue;
    }
    const double start_s = cpu_s();
    const plan::Problem problem = plan::make_problem(*task);
    const plan::Outcome outcome = plan::search(problem, task->scenario, {});
    seconds.push_back(cpu_s() - start_s);
    const std::string error = outcome.plan ? check(toml, *task, outcome) : "";
    found += outcome.plan ? 1 : 0;
    sure += plan::is_surely_possible(number) ? 1 : 0;
    sure_found += outcome.plan && plan::is_surely_possible(number) ? 1 : 0;
    wrong += error.empty() ? 0 : 1;
    fmt::print("{}: {} in {:.2f} s, {} iterations, need {:.4f} of {:.4f}, {}{}\n", number,
               plan::to_string(outcome.status), seconds.back(), outcome.iterations,
               outcome.plan ? outcome.plan->run.extrema.mu_required_max.value : 0, problem.friction_limit,
               words_of(*task), error.empty() ? (outcome.plan ? "" : ": " + outcome.binding) : ": WRONG: " + error);
  }
  std::sort(seconds.begin(), seconds.end());
  if (seconds.empty()) return 1;
  fmt::print("found {} of {} ({} of {} that are surely possible); wrong {}; CPU median {:.2f} s, 95 % {:.2f} s\n",
             found, count, sure_found, sure, wrong, seconds[seconds.size() / 2], seconds[seconds.size() * 95 / 100]);
  return wrong == 0 ? 0 : 1;
}
