#include "tools/plan/write_plan.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "sim/scenario/reader.h"
#include "sim/scenario/tree_nodes.h"

namespace ballast::plan {

using Toml = sim::Node;

namespace {

using sim::array_node;
using sim::number_node;
using sim::numbers_node;
using sim::set_entry;
using sim::text_node;

Toml motion_node(const Grid& grid, const std::vector<double>& knots, std::size_t mass, std::size_t count) {
  Toml motion = array_node();
  for (std::size_t j = 0; j + 1 < static_cast<std::size_t>(grid.knots()); ++j) {
    motion.items.push_back(
        sim::motion_piece_node(grid.piece_s(), knots[j * count + mass], knots[(j + 1) * count + mass]));
  }
  return motion;
}

// Rows of time in s, place in m and f_s/N, as the plant rolled them.
Toml path_node(const Plan& plan) {
  constexpr int kPerPiece = 4;
  const int every = std::max(1, plan.grid.steps_per_piece / kPerPiece);
  Toml path = array_node();
  const auto count = static_cast<int>(plan.run.nodes.size());
  for (int node = 0; node < count; ++node) {
    if (node % every != 0 && node + 1 != count) continue;
    const Node& at = plan.run.nodes[static_cast<std::size_t>(node)];
    const double need = std::hypot(at.value.force_n[0], at.value.force_n[1]) / at.value.normal_n;
    path.items.push_back(numbers_node({node * plan.grid.step_s(), at.place_m[0], at.place_m[1], need}));
  }
  return path;
}

nlohmann::ordered_json final_json(const sim::Plant::Sample& s, std::size_t masses) {
  nlohmann::ordered_json out;
  const auto list = [&](const auto& values) {
    return std::vector<double>(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(masses));
  };
  out["mass_position"] = list(s.mass_position);
  out["mass_velocity"] = list(s.mass_velocity);
  out["orientation"] = std::vector<double>(s.orientation.data(), s.orientation.data() + 4);
  const auto& w = s.angular_velocity_B_radps;
  out["angular_velocity"] = {w[0], w[1], w[2]};
  out["position"] = {s.position_W_m[0], s.position_W_m[1], s.position_W_m[2]};
  return out;
}

}  // namespace

const char* to_string(Status status) {
  return status == Status::kFound ? "found" : status == Status::kInfeasible ? "infeasible" : "not_found";
}

const char* to_string(Objective objective) {
  return objective == Objective::kTime ? "time" : objective == Objective::kEffort ? "effort" : "friction";
}

std::string plan_name(const std::string& task_name) { return sim::name_with(task_name, "_plan"); }

std::string plan_toml(const std::string& toml, const TaskFile& task, const Plan& plan) {
  Toml root;
  std::vector<sim::ScenarioError> errors;
  static_cast<void>(sim::read_tree(toml, "task", root, errors));  // it has been read before
  std::erase_if(root.entries, [](const auto& entry) { return entry.first == "published"; });
  set_entry(root, "name", text_node(plan_name(task.scenario.name)));
  set_entry(root, "duration", number_node(plan.grid.duration_s));
  Toml* masses = root.find("mass");
  for (std::size_t i = 0; i < masses->items.size(); ++i) {
    set_entry(masses->items[i], "motion", motion_node(plan.grid, plan.knots, i, masses->items.size()));
  }
  Toml about;
  set_entry(about, "goal", numbers_node({task.task.goal_m[0], task.task.goal_m[1]}));
  Toml rest;
  rest.kind = sim::NodeKind::kBoolean;
  rest.boolean = task.task.at_rest;
  set_entry(about, "at_rest", rest);
  set_entry(about, "objective", text_node(to_string(task.task.objective)));
  set_entry(about, "mu_required", number_node(plan.run.extrema.mu_required_max.value));
  set_entry(about, "mu_required_time", number_node(plan.run.extrema.mu_required_max.time_s));
  set_entry(about, "goal_error", number_node(plan.goal_error_m));
  set_entry(about, "friction_use", number_node(task.task.friction_use));
  const sim::InitialState& initial = task.scenario.initial;
  const Eigen::Quaterniond& q = initial.orientation;
  const Eigen::Vector3d& w = initial.angular_velocity_B_radps;
  Toml start;
  set_entry(start, "orientation", numbers_node({q.w(), q.x(), q.y(), q.z()}));
  set_entry(start, "angular_velocity", numbers_node({w[0], w[1], w[2]}));
  set_entry(start, "position", numbers_node({initial.position_W_m[0], initial.position_W_m[1]}));
  set_entry(about, "start", start);
  set_entry(about, "path", path_node(plan));
  set_entry(root, "plan", about);
  return sim::to_toml(root) + "\n";
}

std::string outcome_json(const TaskFile& task, const Outcome& outcome, const StepperRun* with_steppers,
                         std::uint64_t seed, double wall_time_s) {
  nlohmann::ordered_json out;
  out["status"] = to_string(outcome.status);
  out["scenario"] = task.scenario.name;
  out["objective"] = to_string(task.task.objective);
  if (outcome.plan) {
    const Plan& plan = *outcome.plan;
    const auto& mu = plan.run.extrema.mu_required_max;
    out["mu_required"] = {{"max", mu.value}, {"time", mu.time_s}};
    out["stepper_mu_required"] = nullptr;
    if (with_steppers != nullptr) {
      const sim::Extremum& need = with_steppers->mu_required_max;
      out["stepper_mu_required"] = {{"max", need.value}, {"time", need.time_s}};
      out["stepper_end"] = {{"reason", with_steppers->end_reason}, {"time", with_steppers->end_time_s}};
    }
    const auto& normal = plan.run.extrema.normal_force_min;
    out["normal_force"] = {{"min", normal.value}, {"min_time", normal.time_s}};
    out["final"] = final_json(plan.run.final, task.scenario.masses.size());
    out["duration"] = plan.grid.duration_s;
    out["goal_error"] = plan.goal_error_m;
    out["via_time"] = plan.via_time_s;
  } else {
    for (const char* key : {"mu_required", "stepper_mu_required", "normal_force", "final", "duration", "goal_error"})
      out[key] = nullptr;
  }
  out["iterations"] = outcome.iterations;
  out["seed"] = seed;
  out["wall_time"] = wall_time_s;
  out["binding"] = outcome.binding;
  return out.dump(2) + "\n";
}

}  // namespace ballast::plan
