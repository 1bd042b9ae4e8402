#include "tools/plan/alternatives.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <span>

namespace ballast::plan {
namespace {

constexpr int kIterations = 200, kWarmIterations = 120;  // of one search, and of one that starts from a plan
constexpr double kNear = 1.03;  // ratio of a value with a plan to one without at which bisection ends
constexpr double kStep = 1.2;   // ratio up to which a plan is a good start for its neighbour
constexpr std::array kLonger{1.2, 1.5, 2.0, 4.0};
constexpr std::array kNearer{0.8, 0.5, 0.25, 0.1, 0.03};

// One of the last of three digits.
double rounding_unit(double value) { return std::pow(10, std::floor(std::log10(value)) - 2); }

// Three digits, rounded up, so that the number in the text is the number that was planned.
double rounded_up(double value) {
  const double unit = rounding_unit(value);
  return unit * std::ceil(value / unit - 1e-9);
}

class Alternation {
 public:
  Alternation(const TaskFile& task, const SearchOptions& options, const LookingFor& looking_for)
      : task_(task), options_(options), looking_for_(looking_for) {}

  std::optional<double> shortest_duration() {
    const auto found = nearest(kLonger, [this](double factor) {
      TaskFile changed = task_;
      changed.task.duration_s = changed.scenario.duration_s = rounded_up(factor * task_.task.duration_s);
      what_ = fmt::format("a longer duration: {:g} s", changed.task.duration_s);
      return changed;
    });
    if (!found) return std::nullopt;
    return found->task.duration_s;
  }

  std::optional<Eigen::Vector2d> nearest_goal() {
    if (!task_.task.via.empty() || task_.task.follow) return std::nullopt;
    const Eigen::Vector2d start_m = make_problem(task_).start_m;
    if (task_.task.goal_m == start_m) return std::nullopt;
    const double unit_m = rounding_unit((task_.task.goal_m - start_m).norm()) / 10;
    const auto found = nearest(kNearer, [&](double factor) {
      TaskFile changed = task_;
      const Eigen::Vector2d place_m = start_m + factor * (task_.task.goal_m - start_m);
      changed.task.goal_m = (place_m / unit_m).array().round() * unit_m;
      what_ = fmt::format("a nearer goal: ({:.6g}, {:.6g}) m", changed.task.goal_m[0], changed.task.goal_m[1]);
      return changed;
    });
    if (!found) return std::nullopt;
    return found->task.goal_m;
  }

  std::optional<double> least_static_friction() {
    what_ = "a floor that holds";
    const Outcome outcome = search_for(task_, nullptr, std::numeric_limits<double>::infinity());
    if (!outcome.plan) return std::nullopt;
    const double use = std::min(task_.task.friction_use, task_.scenario.envelope.friction_use);
    return rounded_up(outcome.plan->run.extrema.mu_required_max.value / use);
  }

 private:
  [[nodiscard]] bool stopped() const { return options_.stop && options_.stop(); }

  // Whether `ballast plan` finds a plan for the task as it is written.
  bool is_found(const TaskFile& task) {
    SearchOptions options = quiet_options();
    options.stepper_need = options_.stepper_need;
    return search(make_problem(task), task.scenario, options).plan.has_value();
  }

  // The search that the caller's options describe, without its starts and with this one's words of progress.
  [[nodiscard]] SearchOptions quiet_options() const {
    SearchOptions options;
    options.seed = options_.seed;
    options.stop = options_.stop;
    options.progress = [this](int, double, double, double) { looking_for_(what_); };
    return options;
  }

  // Any plan that holds will do: the objective is the one that is found most easily.
  Outcome search_for(TaskFile task, const Plan* from, std::optional<double> friction_limit = std::nullopt) {
    task.task.objective = Objective::kFriction;
    task.task.avoid_resonance = false;
    Problem problem = make_problem(task);
    if (friction_limit) problem.friction_limit = *friction_limit;
    SearchOptions options = quiet_options();
    options.most_iterations = kIterations;
    if (from != nullptr) {
      options.from = stretched_motion(task.scenario, from->grid, from->knots, task.task.duration_s);
      options.most_iterations = kWarmIterations;
    }
    return search(problem, task.scenario, options);
  }

  // Tries factors one after another until the task changed by one has a plan. From there it goes back in small steps
  // until one fails, and bisects. Each step starts from the last plan, and if that fails from nothing. Factor 1 is the
  // task itself, which has none. The result is the nearest for which a search from nothing finds a plan, too.
  std::optional<TaskFile> nearest(std::span<const double> factors,
                                  const std::function<TaskFile(double factor)>& changed_by) {
    double failed = 1, held = 1;
    std::vector<TaskFile> with_plan;
    std::optional<Plan> plan;
    const auto try_factor = [&](double factor) {
      const TaskFile changed = changed_by(factor);
      Outcome outcome = search_for(changed, plan ? &*plan : nullptr);
      if (plan && !outcome.plan && !stopped()) outcome = search_for(changed, nullptr);
      (outcome.plan ? held : failed) = factor;
      if (!outcome.plan) return;
      plan = outcome.plan;
      with_plan.push_back(changed);
    };
    for (std::size_t k = 0; k < factors.size() && !plan && !stopped(); ++k) try_factor(factors[k]);
    const auto apart = [&] { return std::max(held / failed, failed / held); };
    while (plan && !stopped() && apart() > kNear) {
      const double ratio = std::min(std::sqrt(apart()), kStep);
      try_factor(held > failed ? held / ratio : held * ratio);
    }
    for (; !with_plan.empty() && !stopped(); with_plan.pop_back()) {
      if (is_found(with_plan.back())) return with_plan.back();
    }
    return std::nullopt;
  }

  const TaskFile& task_;
  const SearchOptions& options_;
  const LookingFor& looking_for_;
  std::string what_;  // that is being looked for
};

}  // namespace

Alternatives find_alternatives(const TaskFile& task, const Outcome& failed, const SearchOptions& options,
                               const LookingFor& looking_for) {
  Alternation search(task, options, looking_for);
  Alternatives out;
  if (failed.friction_alone) out.static_friction = search.least_static_friction();
  out.duration_s = search.shortest_duration();
  out.goal_m = search.nearest_goal();
  return out;
}

std::string alternatives_text(const TaskFile& task, const Alternatives& alternatives) {
  std::string text;
  const auto add = [&](const std::string& words) { text += (text.empty() ? "; plans were found " : ", ") + words; };
  if (alternatives.duration_s) add(fmt::format("for a duration of {:g} s", *alternatives.duration_s));
  if (alternatives.goal_m) {
    const Eigen::Vector2d& goal_m = *alternatives.goal_m;
    add(fmt::format("to ({:.6g}, {:.6g}) m in {:.4g} s, {:.3g} m from the goal", goal_m[0], goal_m[1],
                    task.task.duration_s, (goal_m - task.task.goal_m).norm()));
  }
  if (alternatives.static_friction) add(fmt::format("on a floor of mu_s = {:g}", *alternatives.static_friction));
  return text;
}

}  // namespace ballast::plan
