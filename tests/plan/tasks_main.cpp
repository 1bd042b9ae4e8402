// plan_tasks [--three-masses] [FIRST [COUNT [FILE]]]: plans tasks of the committed set, checks each plan with the
// plant, and prints what was found, and at the end a table for tools/docs/plan.md. --three-masses takes only the tasks
// of the bar on time: three masses, 7 to 9 s. plan_tasks --write FILE COUNT SEED makes a set.
// plan_tasks --slope [FIRST [COUNT [SEED]]] does the same with random tasks on a floor that slopes by 3 degrees and
// resists by 0.02; default 100 tasks of seed 1, made on the spot.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <vector>

#include "tests/plan/task_set.h"
#include "tools/plan/random_task.h"
#include "tools/plan/write_plan.h"

namespace {

using namespace ballast;

double cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// The plan against a run of the file as it would be written.
struct Check {
  std::string broken;  // in words; empty: nothing
  bool wrong_claim = false, missed = false;
};

Check check(const std::string& toml, const plan::TaskFile& task, const plan::Outcome& outcome) {
  Check out;
  const auto read = sim::parse_scenario(plan::plan_toml(toml, task, *outcome.plan), "plan");
  if (!read.ok()) {
    out.wrong_claim = true;
    out.broken = sim::to_string(read.errors.front());
    return out;
  }
  sim::Scenario scenario = read.scenario;
  scenario.run.actuation = sim::Actuation::kPrescribed;
  sim::Plant plant(scenario);
  plant.advance(scenario.duration_s, {});
  const double claimed = outcome.plan->run.extrema.mu_required_max.value,
               rolled = plant.extrema().mu_required_max.value;
  if (plant.end() != sim::PhysicsEnd::kNone) {
    out.wrong_claim = true;
    out.broken = "does not roll to its end";
  } else if (std::abs(claimed - rolled) > 1e-4 * rolled) {
    out.wrong_claim = true;
    out.broken = fmt::format("claims {} and needs {}", claimed, rolled);
  }
  const double off_m = (plant.sample().position_W_m.head<2>() - task.task.goal_m).norm();
  if (off_m > 1e-3) {
    out.missed = true;
    out.broken += fmt::format("{}misses by {} m", out.broken.empty() ? "" : ", ", off_m);
  }
  return out;
}

// The task in a few words: masses, objective, distance in radii, and conditions.
std::string words_of(const plan::TaskFile& file) {
  const plan::Task& task = file.task;
  std::string text = fmt::format("{} masses, {}", file.scenario.masses.size(), plan::to_string(task.objective));
  if (file.scenario.run.actuation == sim::Actuation::kStepper) text += ", steppers";
  text += fmt::format(", {:.2g} r",
                      (task.goal_m - file.scenario.initial.position_W_m).norm() / file.scenario.ball.radius_m);
  if (task.at_rest) text += ", rest";
  if (!task.via.empty()) text += ", via";
  if (!task.keep_out.empty()) text += ", obstacle";
  if (task.follow) text += ", path";
  if (!task.mass_position.empty()) text += ", mass positions";
  return text;
}

// The class that the bar on time speaks of. The set's durations are random, so that it takes 8 s within an eighth.
bool three_masses(const plan::TaskFile& file) {
  return file.scenario.masses.size() == 3 && std::abs(file.task.duration_s - 8) <= 1;
}

// One row of the table.
struct Tally {
  std::string name;
  int tasks = 0, found = 0, wrong = 0, missed = 0;
  std::vector<double> seconds = {};

  void add(bool is_found, const Check& checked, double took_s) {
    ++tasks;
    found += is_found ? 1 : 0;
    wrong += checked.wrong_claim ? 1 : 0;
    missed += checked.missed ? 1 : 0;
    seconds.push_back(took_s);
  }

  void print() {
    if (tasks == 0) return;
    std::sort(seconds.begin(), seconds.end());
    fmt::print("| {} | {} | {} ({:.1f} %) | {} | {} | {:.2f} s | {:.2f} s |\n", name, tasks, found,
               100.0 * found / tasks, wrong, missed, seconds[seconds.size() / 2], seconds[seconds.size() * 95 / 100]);
  }
};

int write(int argc, char** argv) {
  if (argc != 5) {
    fmt::print(stderr, "plan_tasks --write FILE COUNT SEED\n");
    return 1;
  }
  std::string why;
  if (plan::write_task_set(argv[2], std::strtoull(argv[4], nullptr, 10),
                           static_cast<int>(std::strtol(argv[3], nullptr, 10)), why)) {
    return 0;
  }
  fmt::print(stderr, "{}\n", why);
  return 1;
}

// The rows of the table.
struct Table {
  Tally all{"all"}, sure{"shown to be possible"}, rest{"to rest, over a distance that friction allows with ease"};
  Tally three{"three masses, 7 to 9 s"}, three_sure{"three masses, 7 to 9 s, shown to be possible"};
  Tally warm{"three masses, 7 to 9 s, from the plan for a goal 4 % farther"};
  Tally kind[4] = {{"to a place"}, {"to a place, with steppers"}, {"to rest"}, {"to rest, with steppers"}};
  bool by_kind = false;

  void add_kind(const plan::TaskFile& file, bool found, const Check& checked, double took_s) {
    const bool steppers = file.scenario.run.actuation == sim::Actuation::kStepper;
    kind[(file.task.at_rest ? 2 : 0) + (steppers ? 1 : 0)].add(found, checked, took_s);
  }

  void print() {
    fmt::print("|---|---|---|---|---|---|---|\n");
    if (by_kind) {
      all.print();
      for (Tally& tally : kind) tally.print();
      return;
    }
    for (Tally* tally : {&all, &sure, &rest, &three, &three_sure, &warm}) tally->print();
  }

  void add(bool is_sure, bool of_three, bool found, const Check& checked, double took_s) {
    all.add(found, checked, took_s);
    (is_sure ? sure : rest).add(found, checked, took_s);
    if (!of_three) return;
    three.add(found, checked, took_s);
    if (is_sure) three_sure.add(found, checked, took_s);
  }
};

// Plans a found task again with its goal 4 % nearer to the start, from the plan that was found. Prints a line.
void plan_neighbour(const std::string& toml, plan::TaskFile file, const plan::Plan& found, Table& table) {
  const sim::Scenario moved = plan::with_motion(file.scenario, found.grid, found.knots);
  const double start_s = cpu_s();
  plan::Problem problem = plan::make_problem(file);
  file.task.goal_m = problem.start_m + 0.96 * (file.task.goal_m - problem.start_m);
  problem.task.goal_m = file.task.goal_m;
  plan::SearchOptions options;
  for (const sim::Mass& mass : moved.masses) options.from.push_back(mass.motion);
  options.quick = true;
  const plan::Outcome outcome = plan::search(problem, file.scenario, options);
  const double took_s = cpu_s() - start_s;
  table.warm.add(outcome.plan.has_value(), outcome.plan ? check(toml, file, outcome) : Check{}, took_s);
  fmt::print("  from it: {} in {:.3f} s, {} iterations, need {:.4f}\n", plan::to_string(outcome.status), took_s,
             outcome.iterations, outcome.plan ? outcome.plan->run.extrema.mu_required_max.value : 0);
}

// Plans one task and prints a line. True: the plan is not what it claims, or the task is none.
bool plan_one(const plan::SetTask& task, bool only_three_masses, Table& table) {
  std::vector<sim::ScenarioError> errors;
  const auto file = plan::parse_task(task.toml, "task", errors);
  if (!file) {
    fmt::print("{}: no task: {}\n", task.number, sim::to_string(errors.front()));
    return true;
  }
  if (only_three_masses && !three_masses(*file)) return false;
  const double start_s = cpu_s();
  const plan::Problem problem = plan::make_problem(*file);
  const plan::Outcome outcome = plan::search(problem, file->scenario, {});
  const double took_s = cpu_s() - start_s;
  const Check checked = outcome.plan ? check(task.toml, *file, outcome) : Check{};
  table.add(task.sure, three_masses(*file), outcome.plan.has_value(), checked, took_s);
  table.add_kind(*file, outcome.plan.has_value(), checked, took_s);
  std::string end;
  if (!outcome.plan) end = ": " + outcome.binding;
  if (!checked.broken.empty()) end = ": WRONG: " + checked.broken;
  fmt::print("{}: {} in {:.2f} s, {} iterations, need {:.4f} of {:.4f}, {}{}\n", task.number,
             plan::to_string(outcome.status), took_s, outcome.iterations,
             outcome.plan ? outcome.plan->run.extrema.mu_required_max.value : 0, problem.friction_limit,
             words_of(*file), end);
  const bool has_neighbour = !file->task.follow && file->task.objective != plan::Objective::kTime;
  if (only_three_masses && outcome.plan && has_neighbour) plan_neighbour(task.toml, *file, *outcome.plan, table);
  return !checked.broken.empty();
}

// A number among the arguments.
std::uint64_t number_at(int argc, char** argv, int i, std::uint64_t otherwise) {
  return i < argc ? std::strtoull(argv[i], nullptr, 10) : otherwise;
}

void print_head(int first, int last) {
  fmt::print("\n| tasks {} to {} | number | found | wrong claims | goal missed | median CPU | 95 % |\n", first, last);
}

int plan_on_slopes(int argc, char** argv) {
  const int first = static_cast<int>(number_at(argc, argv, 2, 0));
  const int count = static_cast<int>(number_at(argc, argv, 3, 100));
  const std::uint64_t seed = number_at(argc, argv, 4, 1);
  constexpr plan::RandomFloor kFloor{3 * std::numbers::pi / 180, 0.02};
  Table table;
  table.by_kind = true;
  bool wrong = count == 0;
  for (int number = first; number < first + count; ++number) {
    std::string why;
    const auto toml = plan::random_floor_task(seed, number, kFloor, why);
    if (!toml) {
      fmt::print("{}: {}\n", number, why);
      wrong = true;
      continue;
    }
    wrong = plan_one({number, true, *toml}, false, table) || wrong;
  }
  print_head(first, first + count - 1);
  table.print();
  return wrong ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::setvbuf(stdout, nullptr, _IOLBF, 1 << 12);  // shows the tasks as they are done
  if (argc > 1 && std::string(argv[1]) == "--write") return write(argc, argv);
  if (argc > 1 && std::string(argv[1]) == "--slope") return plan_on_slopes(argc, argv);
  const bool only_three_masses = argc > 1 && std::string(argv[1]) == "--three-masses";
  const int options = only_three_masses ? 1 : 0;
  const int first = static_cast<int>(number_at(argc, argv, 1 + options, 0));
  const int count = static_cast<int>(number_at(argc, argv, 2 + options, 1000));
  std::string why;
  const auto tasks = plan::read_task_set(argc > 3 + options ? argv[3 + options] : BALLAST_TASK_SET, why);
  if (tasks.empty()) {
    fmt::print(stderr, "{}\n", why);
    return 1;
  }
  Table table;
  int last = first - 1;
  bool wrong = false;
  for (const plan::SetTask& task : tasks) {
    if (task.number < first || task.number >= first + count) continue;
    last = task.number;
    wrong = plan_one(task, only_three_masses, table) || wrong;
  }
  print_head(first, last);
  table.print();
  return wrong || table.all.tasks == 0 ? 1 : 0;
}
