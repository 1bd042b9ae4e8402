// ballast plan --chart: what a robot can do over the distance of a task, as a table, files and a picture.
#include <fmt/core.h>

#include <array>
#include <iostream>

#include "tools/ballast/commands.h"
#include "tools/ballast/plan_command.h"
#include "tools/ballast/stepper_run.h"
#include "tools/plan/chart.h"
#include "tools/program/program.h"
#include "tools/program/subprocess.h"

namespace ballast {
namespace {

struct ChartFiles {
  std::filesystem::path json, csv, picture;
};

ChartFiles files_of(const PlanCommand& command, const std::string& name) {
  const std::filesystem::path json = command.out.empty() ? name + "_chart.json" : command.out;
  return {json, std::filesystem::path(json).replace_extension(".csv"),
          std::filesystem::path(json).replace_extension(".png")};
}

// Empty, or why these options do not go with --chart.
std::string chart_refusal(const PlanCommand& command) {
  if (!command.from.empty()) return "--from: not with --chart, which starts each plan from its neighbour";
  if (!command.out.empty() && std::filesystem::path(command.out).extension() != ".json")
    return fmt::format("--out: {} is no name for a chart; allowed with --chart: a name that ends in .json",
                       command.out);
  return "";
}

// Rolls each plan with its motors, on a floor that holds whatever they need. `stop` leaves the rest without.
void add_steppers(const plan::TaskFile& task, plan::Chart& chart, const Stop& stop) {
  if (task.scenario.run.actuation != sim::Actuation::kStepper) return;
  for (plan::ChartPoint& point : chart.points) {
    if (!point.outcome.plan) continue;
    sim::Scenario moved = with_motion(task.scenario, point.outcome.plan->grid, point.outcome.plan->knots);
    moved.run.actuation = sim::Actuation::kStepper;
    const SteppedRun run = run_with_steppers(on_perfect_floor(moved), stop);
    if (run.result)
      point.with_steppers = need_of(*run.result);
    else if (stop())
      chart.complete = false;
  }
}

void draw_chart(const ChartFiles& files) {
  program::Subprocess drawer;
  const auto error =
      drawer.start({.arguments = {program::beside_this_program("ballast-chart"), std::filesystem::absolute(files.json),
                                  std::filesystem::absolute(files.picture)}});
  if (error || drawer.wait().exit_status != 0)
    program::complain("ballast", "the picture could not be drawn; the chart itself is complete");
}

}  // namespace

int chart_task(const PlanCommand& command) {
  if (const std::string why = chart_refusal(command); !why.empty()) return refuse(why);
  const auto task = task_of(command);
  if (!task) return program::kExitUsage;
  const ChartFiles files = files_of(command, task->scenario.name);
  for (const auto& file : {files.json, files.csv, files.picture}) {
    if (const std::string why = in_the_way(file); !why.empty()) return could_not(why);
  }
  const auto start = Clock::now();
  const volatile std::sig_atomic_t* signalled = program::catch_signals();
  ProgressLine line(command.quiet);
  plan::ChartOptions options;
  options.seed = command.seed;
  options.stop = stop_of(command, start, signalled);
  options.progress = [&](int planned, double duration_s) {
    if (line.due()) line.show(fmt::format("{} durations planned, the last of {:.3g} s", planned, duration_s));
  };
  plan::Chart chart = make_chart(*task, options);
  line.end();
  const bool any = std::any_of(chart.points.begin(), chart.points.end(), [](const auto& p) { return p.outcome.plan; });
  if (!any) {
    const std::string why = chart.points.empty() || *signalled != 0 ? "interrupted before a plan was found"
                                                                    : chart.points.back().outcome.binding;
    program::complain("ballast", fmt::format("{}: no chart: {}", task->scenario.name, why));
    return *signalled != 0 ? program::kExitCouldNotRun : program::kExitEnvelope;
  }
  add_steppers(*task, chart, stop_of(command, start, signalled, kMotorsAllowance_s));
  if (!write_file(files.json, chart_json(*task, chart, command.seed)))
    return could_not(fmt::format("{}: cannot be written", files.json.string()));
  if (!write_file(files.csv, chart_csv(chart)))
    return could_not(fmt::format("{}: cannot be written", files.csv.string()));
  draw_chart(files);
  if (command.quiet) return program::kExitCompleted;
  std::cout << chart_text(*task, chart);
  if (!chart.complete) std::cout << "\nended early: durations or runs with motors are missing\n";
  std::cout << fmt::format("\nwritten: {}, {}, {}\n", files.json.string(), files.csv.string(), files.picture.string())
            << std::flush;
  return program::kExitCompleted;
}

}  // namespace ballast
