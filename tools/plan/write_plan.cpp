#include "tools/plan/write_plan.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "sim/scenario/reader.h"
#include "sim/scenario/tree.h"

namespace ballast::plan {

using Toml = sim::Node;

namespace {

constexpr std::size_t kLongestName = 64;  // that a scenario may have

void set(Toml& table, const std::string& key, Toml value) {
  if (Toml* old = table.find(key)) {
    *old = std::move(value);
  } else {
    table.entries.emplace_back(key, std::move(value));
  }
}

Toml number(double value) {
  Toml node;
  node.kind = sim::NodeKind::kFloat;
  node.number = value;
  return node;
}

Toml text(const std::string& value) {
  Toml node;
  node.kind = sim::NodeKind::kString;
  node.text = value;
  return node;
}

Toml numbers(std::initializer_list<double> values) {
  Toml node;
  node.kind = sim::NodeKind::kArray;
  for (const double value : values) node.items.push_back(number(value));
  return node;
}

Toml motion_node(const Grid& grid, const std::vector<double>& knots, std::size_t mass, std::size_t count) {
  Toml motion;
  motion.kind = sim::NodeKind::kArray;
  for (std::size_t j = 0; j + 1 < static_cast<std::size_t>(grid.knots()); ++j) {
    Toml piece;
    set(piece, "duration", number(grid.piece_s()));
    set(piece, "acceleration", numbers({knots[j * count + mass], knots[(j + 1) * count + mass]}));
    motion.items.push_back(std::move(piece));
  }
  return motion;
}

// Rows of time in s, place in m and f_s/N, as the plant rolled them.
Toml path_node(const Plan& plan) {
  constexpr int kPerPiece = 4;
  const int every = std::max(1, plan.grid.steps_per_piece / kPerPiece);
  Toml path;
  path.kind = sim::NodeKind::kArray;
  const auto count = static_cast<int>(plan.run.nodes.size());
  for (int node = 0; node < count; ++node) {
    if (node % every != 0 && node + 1 != count) continue;
    const Node& at = plan.run.nodes[static_cast<std::size_t>(node)];
    const double need = std::hypot(at.value.force_n[0], at.value.force_n[1]) / at.value.normal_n;
    path.items.push_back(numbers({node * plan.grid.step_s(), at.place_m[0], at.place_m[1], need}));
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

std::string plan_name(const std::string& task_name) {
  const std::string end = "_plan";
  return task_name.substr(0, kLongestName - end.size()) + end;
}

std::string plan_toml(const std::string& toml, const TaskFile& task, const Plan& plan) {
  Toml root;
  std::vector<sim::ScenarioError> errors;
  static_cast<void>(sim::read_tree(toml, "task", root, errors));  // it has been read before
  std::erase_if(root.entries, [](const auto& entry) { return entry.first == "published"; });
  set(root, "name", text(plan_name(task.scenario.name)));
  set(root, "duration", number(plan.grid.duration_s));
  Toml* masses = root.find("mass");
  for (std::size_t i = 0; i < masses->items.size(); ++i) {
    set(masses->items[i], "motion", motion_node(plan.grid, plan.knots, i, masses->items.size()));
  }
  Toml about;
  set(about, "goal", numbers({task.task.goal_m[0], task.task.goal_m[1]}));
  Toml rest;
  rest.kind = sim::NodeKind::kBoolean;
  rest.boolean = task.task.at_rest;
  set(about, "at_rest", rest);
  set(about, "objective", text(to_string(task.task.objective)));
  set(about, "mu_required", number(plan.run.extrema.mu_required_max.value));
  set(about, "mu_required_time", number(plan.run.extrema.mu_required_max.time_s));
  set(about, "goal_error", number(plan.goal_error_m));
  set(about, "friction_use", number(task.task.friction_use));
  const sim::InitialState& initial = task.scenario.initial;
  const Eigen::Quaterniond& q = initial.orientation;
  const Eigen::Vector3d& w = initial.angular_velocity_B_radps;
  Toml start;
  set(start, "orientation", numbers({q.w(), q.x(), q.y(), q.z()}));
  set(start, "angular_velocity", numbers({w[0], w[1], w[2]}));
  set(start, "position", numbers({initial.position_W_m[0], initial.position_W_m[1]}));
  set(about, "start", start);
  set(about, "path", path_node(plan));
  set(root, "plan", about);
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
