// The chart of a robot over the distance of a task: the least friction over the time allowed, and from that curve the
// shortest time over mu_s.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tools/plan/read_task.h"
#include "tools/plan/search.h"
#include "tools/plan/write_plan.h"

namespace ballast::plan {

struct ChartPoint {
  double duration_s = 0;
  Outcome outcome;  // without a plan: its words say which limit stands in the way
  std::optional<StepperRun> with_steppers;
};

struct ChartOptions {
  std::uint64_t seed = 0;
  std::function<bool()> stop;  // ends the sweep with the points planned so far
  std::function<void(int planned, double duration_s)> progress;
};

struct Chart {
  std::vector<ChartPoint> points;  // shortest duration first; those without a plan come before those with one
  double friction_use = 1;         // a floor of mu_s lets a plan use friction_use mu_s
  double distance_m = 0;
  bool complete = true;  // false: options.stop ended it
};

// Plans the task for durations from a quarter of task.duration to twice it, each from the plan of its neighbour, with
// objective "friction" and on a floor without a friction limit. Durations below the shortest for which a plan is found
// are left out; that one is located within 3 %. Via places with a time lose it.
[[nodiscard]] Chart make_chart(const TaskFile& task, const ChartOptions& options);

// The shortest duration for a floor, read off the curve.
struct ShortestTime {
  double mu_s = 0;
  std::optional<double> duration_s;       // none: longer than the curve
  bool motion_limits = false;             // friction is not what keeps it from being shorter
  std::optional<double> with_steppers_s;  // the shortest planned duration that needs at most mu_s with steppers
};
[[nodiscard]] std::vector<ShortestTime> shortest_times(const Chart& chart);

[[nodiscard]] std::string chart_text(const TaskFile& task, const Chart& chart);
[[nodiscard]] std::string chart_json(const TaskFile& task, const Chart& chart, std::uint64_t seed);
[[nodiscard]] std::string chart_csv(const Chart& chart);

}  // namespace ballast::plan
