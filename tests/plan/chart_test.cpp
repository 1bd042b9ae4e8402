// The chart of a robot: its points are plans, its curves fall, and the shortest times are read off them.
#include "tools/plan/chart.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace ballast::plan {
namespace {

const std::string kTask = R"(name = "test"
gravity = 9.81
[ball]
radius = 0.15
mass = 0.8
inertia = [0.0118, 0.0118, 0.0118]
[surface]
static_friction = 0.001
[[mass]]
mass = 0.5
rail = { shape = "circle", radius = 0.095, axes = [[0, 0, -1], [1, 0, 0]] }
[run]
actuation = "prescribed"
[task]
goal = [0.3, 0.0]
duration = 4.0
)";

TaskFile task_of(const std::string& toml) {
  std::vector<sim::ScenarioError> errors;
  const auto task = parse_task(toml, "task.toml", errors);
  EXPECT_TRUE(task) << (errors.empty() ? "" : sim::to_string(errors.front()));
  return task.value_or(TaskFile{});
}

double need_of(const ChartPoint& point) { return point.outcome.plan->run.extrema.mu_required_max.value; }

// The floor of the task is far too smooth for any of these motions, which the chart ignores.
TEST(Chart, NeedFallsWithTheTime) {
  const TaskFile task = task_of(kTask);
  const Chart chart = make_chart(task, {});
  ASSERT_GE(chart.points.size(), 10u);
  EXPECT_TRUE(chart.complete);
  EXPECT_DOUBLE_EQ(chart.distance_m, 0.3);
  EXPECT_DOUBLE_EQ(chart.points.back().duration_s, 8.0);
  const ChartPoint* before = nullptr;
  for (const ChartPoint& point : chart.points) {
    if (!point.outcome.plan) {
      EXPECT_EQ(before, nullptr) << "a duration without a plan above one with a plan";
      continue;
    }
    EXPECT_DOUBLE_EQ(point.outcome.plan->grid.duration_s, point.duration_s);
    EXPECT_LT(point.outcome.plan->goal_error_m, 1e-3);
    // From rest to rest 4 d / (g T^2) is the least on average; the planner's own bar is 1.4 times that.
    const double bound = 4 * 0.3 / (9.81 * point.duration_s * point.duration_s);
    EXPECT_GT(need_of(point), 0.95 * bound);
    if (before != nullptr) {
      EXPECT_GT(point.duration_s, before->duration_s);
      EXPECT_LT(need_of(point), need_of(*before));
    }
    before = &point;
  }
}

TEST(Chart, IsTheSameAgain) {
  const TaskFile task = task_of(kTask);
  EXPECT_EQ(chart_json(task, make_chart(task, {}), 0), chart_json(task, make_chart(task, {}), 0));
}

TEST(Chart, KeepsWhatWasPlannedBeforeAStop) {
  int planned = 0;
  ChartOptions options;
  options.progress = [&](int count, double) { planned = count; };
  options.stop = [&] { return planned >= 3; };
  const Chart chart = make_chart(task_of(kTask), options);
  EXPECT_FALSE(chart.complete);
  EXPECT_GE(chart.points.size(), 3u);
  EXPECT_LE(chart.points.size(), 4u);
}

// A chart by hand: needs of 0.4 at 1 s and 0.1 at 2 s, which is 1 / T^2.
Chart by_hand() {
  Chart chart;
  chart.friction_use = 0.5;
  for (const auto& [duration_s, need] : {std::pair(1.0, 0.4), std::pair(2.0, 0.1)}) {
    ChartPoint point;
    point.duration_s = duration_s;
    point.outcome.plan.emplace();
    point.outcome.plan->run.extrema.mu_required_max = {need, 0};
    point.with_steppers = StepperRun{{0.25 * duration_s, 0}, "completed", duration_s};
    chart.points.push_back(point);
  }
  return chart;
}

TEST(Chart, ShortestTimesAreReadOffTheCurve) {
  for (const ShortestTime& row : shortest_times(by_hand())) {
    const double limit = 0.5 * row.mu_s;
    if (limit < 0.1) {
      EXPECT_FALSE(row.duration_s) << row.mu_s;
    } else if (limit >= 0.4) {
      EXPECT_EQ(row.duration_s, 1.0) << row.mu_s;
      EXPECT_TRUE(row.motion_limits) << row.mu_s;
    } else {
      ASSERT_TRUE(row.duration_s) << row.mu_s;
      EXPECT_NEAR(*row.duration_s, std::sqrt(0.4 / limit), 1e-12) << row.mu_s;  // roundings of O(1) values
    }
    EXPECT_EQ(row.with_steppers_s.has_value(), row.mu_s >= 0.25) << row.mu_s;
  }
}

TEST(Chart, MoreTimeNeverNeedsMore) {
  Chart chart = by_hand();
  std::swap(chart.points[0].outcome, chart.points[1].outcome);  // now the shorter motion needs less
  for (const ShortestTime& row : shortest_times(chart)) {
    if (0.5 * row.mu_s >= 0.1) EXPECT_EQ(row.duration_s, 1.0);
  }
}

TEST(Chart, TextAndTablesHaveEveryDuration) {
  TaskFile task;
  task.scenario.name = "robot";
  task.scenario.run.actuation = sim::Actuation::kStepper;
  Chart chart = by_hand();
  chart.points[1].with_steppers->end_reason = "detached";
  chart.points[1].outcome.binding =
      "the time (task.duration), the step rate of mass 1 (motor.max_step_rate), the step rate of mass 0 "
      "(motor.max_step_rate)";
  const std::string text = chart_text(task, chart);
  EXPECT_NE(text.find("         1       0.4           0.25"), std::string::npos) << text;
  EXPECT_NE(text.find("         2       0.1       detached  the step rate of masses 0, 1\n"), std::string::npos)
      << text;
  EXPECT_EQ(text.find(" \n"), std::string::npos) << "a line ends in blanks";
  const std::string csv = chart_csv(chart);
  EXPECT_NE(csv.find("\n1,0.4,0.25,completed,"), std::string::npos) << csv;
  const auto json = nlohmann::json::parse(chart_json(task, chart, 7));
  EXPECT_EQ(json["seed"], 7);
  EXPECT_EQ(json["points"][1]["stepper_end"], "detached");
}

}  // namespace
}  // namespace ballast::plan
