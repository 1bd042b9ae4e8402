#include "tools/plan/chart.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

namespace ballast::plan {
namespace {

constexpr int kPerDoubling = 4;  // durations of the sweep
constexpr int kShorter = 2 * kPerDoubling, kLonger = kPerDoubling;
constexpr int kBisections = 3;    // from a ratio of 1.19 to one of 1.02
constexpr int kIterations = 300;  // of a search from a neighbour
constexpr double kWorse = 1.05;   // than a neighbour's motion, slowed down: try from that
constexpr std::array kFloors{0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0};

// Three digits, so that tables show the durations as they are.
double rounded(double duration_s) {
  const double unit = std::pow(10, std::floor(std::log10(duration_s)) - 2);
  return unit * std::round(duration_s / unit);
}

double need_of(const ChartPoint& point) { return point.outcome.plan->run.extrema.mu_required_max.value; }

bool shorter_first(const ChartPoint& a, const ChartPoint& b) { return a.duration_s < b.duration_s; }

class Sweep {
 public:
  Sweep(const TaskFile& task, const ChartOptions& options) : task_(task), options_(options) {
    task_.task.objective = Objective::kFriction;
    for (Via& via : task_.task.via) via.time_s.reset();
  }

  std::vector<ChartPoint> run() {
    const int given = find_first();
    if (given < 0) return std::move(points_);
    longer(given);
    shorter();
    again();
    return std::move(points_);
  }

 private:
  [[nodiscard]] double duration_of(int step) const {
    return rounded(task_.task.duration_s * std::exp2(static_cast<double>(step) / kPerDoubling));
  }
  [[nodiscard]] bool stopped() const { return options_.stop && options_.stop(); }

  ChartPoint plan(double duration_s, const Plan* from) {
    TaskFile task = task_;
    task.task.duration_s = task.scenario.duration_s = duration_s;
    Problem problem = make_problem(task);
    problem.friction_limit = std::numeric_limits<double>::infinity();
    SearchOptions options;
    options.seed = options_.seed;
    options.stop = options_.stop;
    if (from != nullptr) {
      options.from = stretched_motion(task.scenario, from->grid, from->knots, duration_s);
      options.most_iterations = kIterations;
    }
    ChartPoint point{duration_s, search(problem, task.scenario, options), std::nullopt};
    ++planned_;
    if (options_.progress) options_.progress(planned_, duration_s);
    return point;
  }

  // The task's own duration, or the next longer one for which a plan is found. -1: none.
  int find_first() {
    for (int step = 0; step <= kLonger && !stopped(); ++step) {
      points_.push_back(plan(duration_of(step), nullptr));
      if (points_.back().outcome.plan) return step;
    }
    return -1;
  }

  void longer(int first) {
    for (int step = first + 1; step <= kLonger && !stopped(); ++step) {
      ChartPoint point = plan(duration_of(step), &*points_.back().outcome.plan);
      if (point.outcome.plan) points_.push_back(std::move(point));
    }
  }

  // Shorter and shorter durations, and where one fails, those between it and the last that did not.
  void shorter() {
    ChartPoint last = *std::find_if(points_.begin(), points_.end(), [](const auto& p) { return p.outcome.plan; });
    std::optional<double> failed_s;
    for (const ChartPoint& point : points_) {
      if (!point.outcome.plan) failed_s = point.duration_s;
    }
    int step = 0;
    while (!failed_s && --step >= -kShorter && !stopped()) {
      ChartPoint point = plan(duration_of(step), &*last.outcome.plan);
      if (!point.outcome.plan)
        failed_s = point.duration_s;
      else
        last = point;
      points_.push_back(std::move(point));
    }
    for (int k = 0; k < kBisections && failed_s && !stopped(); ++k) {
      const double middle_s = rounded(std::sqrt(*failed_s * last.duration_s));
      if (!(middle_s > *failed_s && middle_s < last.duration_s)) return;
      ChartPoint point = plan(middle_s, &*last.outcome.plan);
      if (!point.outcome.plan)
        failed_s = middle_s;
      else
        last = point;
      points_.push_back(std::move(point));
    }
  }

  // From shorter to longer durations: more time cannot need more friction, so a point that does has found another,
  // worse kind of motion than its neighbour. It is planned again from that, and if need be from anywhere.
  void again() {
    std::sort(points_.begin(), points_.end(), shorter_first);
    for (std::size_t k = 1; k < points_.size() && !stopped(); ++k) {
      if (!points_[k - 1].outcome.plan || !points_[k].outcome.plan) continue;
      const double ratio = points_[k - 1].duration_s / points_[k].duration_s;
      const double aim = kWorse * need_of(points_[k - 1]) * ratio * ratio;
      if (need_of(points_[k]) > aim) keep_better(points_[k], &*points_[k - 1].outcome.plan);
      if (need_of(points_[k]) > aim) keep_better(points_[k], nullptr);
    }
  }

  void keep_better(ChartPoint& point, const Plan* from) {
    ChartPoint other = plan(point.duration_s, from);
    if (other.outcome.plan && need_of(other) < need_of(point)) point = std::move(other);
  }

  TaskFile task_;
  const ChartOptions& options_;
  std::vector<ChartPoint> points_;
  int planned_ = 0;
};

// The points with a plan, with what each needs if it may take less time than it has.
struct Curve {
  std::vector<double> duration_s, need;
};

Curve falling_curve(const Chart& chart) {
  Curve curve;
  for (const ChartPoint& point : chart.points) {
    if (!point.outcome.plan) continue;
    const double before = curve.need.empty() ? std::numeric_limits<double>::infinity() : curve.need.back();
    curve.duration_s.push_back(point.duration_s);
    curve.need.push_back(std::min(before, need_of(point)));
  }
  return curve;
}

bool holds_with_steppers(const ChartPoint& point, double mu_s) {
  return point.with_steppers && point.with_steppers->end_reason == "completed" &&
         point.with_steppers->mu_required_max.value <= mu_s;
}

// The limits of a plan, short enough for a table: "the step rate of masses 0, 2" for "the time (task.duration), the
// step rate of mass 0 (motor.max_step_rate), ...".
std::string short_words(const std::string& binding) {
  std::vector<std::pair<std::string, std::set<std::string>>> groups;  // words, and the masses that they are said of
  std::string plain = binding;
  for (std::size_t open = plain.find(" ("); open != std::string::npos; open = plain.find(" ("))
    plain.erase(open, plain.find(')', open) + 1 - open);
  std::istringstream parts(plain);
  for (std::string part; std::getline(parts, part, ',');) {
    part.erase(0, part.find_first_not_of(' '));
    const std::size_t at = part.rfind(" of mass ");
    const std::string what = at == std::string::npos ? part : part.substr(0, at);
    auto group = std::find_if(groups.begin(), groups.end(), [&](const auto& g) { return g.first == what; });
    if (group == groups.end()) group = groups.insert(groups.end(), {what, {}});
    if (at != std::string::npos) group->second.insert(part.substr(at + 9));
  }
  if (groups.size() > 1 && groups.front().first == "the time") groups.erase(groups.begin());
  std::string text;
  for (const auto& [what, masses] : groups) {
    text += (text.empty() ? "" : ", ") + what;
    std::string numbers;
    for (const std::string& mass : masses) numbers += (numbers.empty() ? "" : ", ") + mass;
    if (!masses.empty()) text += (masses.size() > 1 ? " of masses " : " of mass ") + numbers;
  }
  return text;
}

// Why no plan was found on a floor without a friction limit.
std::string failure_words(const std::string& binding) {
  const std::string first = binding.substr(0, binding.find(';'));
  return "no plan: " +
         (first.starts_with("friction") ? "none of the motions found held when the plant rolled it" : first);
}

const ChartPoint* shortest_plan(const Chart& chart) {
  const auto found =
      std::find_if(chart.points.begin(), chart.points.end(), [](const auto& p) { return p.outcome.plan; });
  return found == chart.points.end() ? nullptr : &*found;
}

std::string without_trailing_blanks(std::string text) {
  std::size_t at = text.find(" \n");
  while (at != std::string::npos) {
    text.erase(at, 1);
    at = text.find(" \n");
  }
  return text;
}

std::string steppers_text(const std::optional<StepperRun>& run) {
  if (!run) return "";
  if (run->end_reason != "completed") return run->end_reason;
  return fmt::format("{:.3g}", run->mu_required_max.value);
}

}  // namespace

Chart make_chart(const TaskFile& task, const ChartOptions& options) {
  Chart chart;
  chart.friction_use = std::min(task.task.friction_use, task.scenario.envelope.friction_use);
  chart.distance_m = (task.task.goal_m - Eigen::Vector2d(task.scenario.initial.position_W_m)).norm();
  chart.points = Sweep(task, options).run();
  chart.complete = !(options.stop && options.stop());
  return chart;
}

std::vector<ShortestTime> shortest_times(const Chart& chart) {
  std::vector<ShortestTime> out;
  const Curve curve = falling_curve(chart);
  if (curve.need.empty()) return out;
  for (const double mu_s : kFloors) {
    ShortestTime row{mu_s, std::nullopt, false, std::nullopt};
    const double limit = chart.friction_use * mu_s;
    const auto first = std::find_if(curve.need.begin(), curve.need.end(), [&](double need) { return need <= limit; });
    if (first == curve.need.begin()) {
      row.duration_s = curve.duration_s.front();
      row.motion_limits = true;
    } else if (first != curve.need.end()) {
      // Between two points need and duration are a straight line of their logarithms: f_s/N goes with 1 / T^2.
      const auto k = static_cast<std::size_t>(first - curve.need.begin());
      const double part = std::log(limit / curve.need[k]) / std::log(curve.need[k - 1] / curve.need[k]);
      row.duration_s = curve.duration_s[k] * std::pow(curve.duration_s[k - 1] / curve.duration_s[k], part);
    }
    for (const ChartPoint& point : chart.points) {
      if (!row.with_steppers_s && holds_with_steppers(point, mu_s)) row.with_steppers_s = point.duration_s;
    }
    out.push_back(row);
  }
  return out;
}

std::string chart_text(const TaskFile& task, const Chart& chart) {
  std::string text = fmt::format("{}: {:.4g} m, {}\n", task.scenario.name, chart.distance_m,
                                 task.task.at_rest ? "at rest at the end" : "passing the goal");
  const bool steppers = task.scenario.run.actuation == sim::Actuation::kStepper;
  const auto last_column = [&](const std::string& plan, const std::string& motors) {
    return steppers ? fmt::format("{:>8}  {:>13}  ", plan, motors) : fmt::format("{:>8}  ", plan);
  };
  text += fmt::format("\nthe least friction over the time\n  {:>8}  {}limited by\n", "time [s]",
                      last_column("f_s/N", "with steppers"));
  const ChartPoint* first_plan = shortest_plan(chart);
  for (const ChartPoint& point : chart.points) {
    const std::string need = point.outcome.plan ? fmt::format("{:.3g}", need_of(point)) : "-";
    const bool longest_failed = &point + 1 == first_plan;
    if (!point.outcome.plan && !longest_failed) continue;
    const std::string why =
        point.outcome.plan ? short_words(point.outcome.binding) : failure_words(point.outcome.binding);
    text +=
        fmt::format("  {:>8g}  {}{}\n", point.duration_s, last_column(need, steppers_text(point.with_steppers)), why);
  }
  text += fmt::format("\nthe shortest time over the floor, where f_s <= {:g} mu_s N\n  {:>8}  {}\n", chart.friction_use,
                      "mu_s", last_column("time [s]", "with steppers"));
  for (const ShortestTime& row : shortest_times(chart)) {
    const std::string time = row.duration_s ? fmt::format("{:.3g}", *row.duration_s) : "longer";
    const std::string motors = row.with_steppers_s ? fmt::format("{:.3g}", *row.with_steppers_s) : "none";
    text += fmt::format("  {:>8g}  {}{}\n", row.mu_s, last_column(time, motors),
                        row.motion_limits ? "not limited by friction" : "");
  }
  return without_trailing_blanks(text);
}

std::string chart_json(const TaskFile& task, const Chart& chart, std::uint64_t seed) {
  nlohmann::ordered_json out;
  out["scenario"] = task.scenario.name;
  out["distance"] = chart.distance_m;
  out["at_rest"] = task.task.at_rest;
  out["actuation"] = to_string(task.scenario.run.actuation);
  out["friction_use"] = chart.friction_use;
  const double floor = task.scenario.surface.static_friction;
  out["static_friction"] = std::isfinite(floor) ? nlohmann::ordered_json(floor) : nullptr;
  out["task_duration"] = task.task.duration_s;
  out["complete"] = chart.complete;
  out["seed"] = seed;
  out["points"] = nlohmann::ordered_json::array();
  for (const ChartPoint& point : chart.points) {
    nlohmann::ordered_json row{{"duration", point.duration_s},
                               {"mu_required", nullptr},
                               {"stepper_mu_required", nullptr},
                               {"stepper_end", nullptr},
                               {"binding", point.outcome.binding}};
    if (point.outcome.plan) row["mu_required"] = need_of(point);
    if (point.with_steppers) {
      const double need = point.with_steppers->mu_required_max.value;
      if (std::isfinite(need)) row["stepper_mu_required"] = need;
      row["stepper_end"] = point.with_steppers->end_reason;
    }
    out["points"].push_back(row);
  }
  out["shortest_time"] = nlohmann::ordered_json::array();
  for (const ShortestTime& row : shortest_times(chart)) {
    const auto number = [](const std::optional<double>& value) {
      return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
    };
    out["shortest_time"].push_back({{"mu_s", row.mu_s},
                                    {"duration", number(row.duration_s)},
                                    {"limited_by_friction", !row.motion_limits},
                                    {"stepper_duration", number(row.with_steppers_s)}});
  }
  return out.dump(2) + "\n";
}

std::string chart_csv(const Chart& chart) {
  std::string text = "duration_s,mu_required,stepper_mu_required,stepper_end,binding\n";
  for (const ChartPoint& point : chart.points) {
    text += fmt::format("{:g},", point.duration_s);
    text += point.outcome.plan ? fmt::format("{:.6g},", need_of(point)) : ",";
    text += point.with_steppers
                ? fmt::format("{:.6g},{},", point.with_steppers->mu_required_max.value, point.with_steppers->end_reason)
                : ",,";
    text += fmt::format("\"{}\"\n", point.outcome.binding);
  }
  return text;
}

}  // namespace ballast::plan
