#include "tools/plan/read_task.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "sim/scenario/reader.h"
#include "sim/scenario/tree.h"
#include "tools/program/params.h"

namespace ballast::plan {

using Toml = sim::Node;
using sim::NodeKind;
using sim::number_text;
using sim::Range;
using sim::TableReader;

namespace {

constexpr std::size_t kMostPlaces = 100;  // of via, keep_out and follow

// Places of two numbers under `key`. Each wrong entry is reported.
std::optional<std::vector<Eigen::Vector2d>> read_places(TableReader& table, const std::string& key, std::size_t least) {
  const std::string allowed =
      fmt::format("an array of {} to {} places, each an array of 2 numbers, in m", least, kMostPlaces);
  const Toml* node = table.node(key);
  if (node == nullptr || node->kind != NodeKind::kArray || node->items.size() < least ||
      node->items.size() > kMostPlaces) {
    table.refuse(key, (node == nullptr ? "is missing; allowed: " : "is no such list; allowed: ") + allowed);
    return std::nullopt;
  }
  std::vector<Eigen::Vector2d> places;
  for (std::size_t k = 0; k < node->items.size(); ++k) {
    const Toml& item = node->items[k];
    const auto number = [](const Toml& n) { return n.kind == NodeKind::kInteger || n.kind == NodeKind::kFloat; };
    const bool good = item.kind == NodeKind::kArray && item.items.size() == 2 && number(item.items[0]) &&
                      number(item.items[1]) && Range::any().contains(item.items[0].number) &&
                      Range::any().contains(item.items[1].number);
    if (good) {
      places.emplace_back(item.items[0].number, item.items[1].number);
    } else {
      table.refuse(fmt::format("{}.{}", key, k), "is no place; allowed: an array of 2 finite numbers, in m");
    }
  }
  return places.size() == node->items.size() ? std::optional(places) : std::nullopt;
}

void read_via(TableReader& table, Task& task) {
  const std::string allowed =
      fmt::format("an array of at most {} tables {{ position = [x, y], time = t }}, time optional", kMostPlaces);
  auto readers = table.tables("via", allowed);
  if (readers.size() > kMostPlaces)
    table.refuse("via", fmt::format("has {} entries; allowed: {}", readers.size(), allowed));
  double before_s = 0;
  for (std::size_t k = 0; k < readers.size(); ++k) {
    const auto position = readers[k].vector<2>("position", Range::any("m"));
    readers[k].know({"time"});
    std::optional<double> time;
    if (readers[k].has("time")) {
      time = readers[k].number("time", Range::positive("s"));
      if (time && task.duration_s > 0 && !(*time < task.duration_s)) {
        readers[k].refuse(
            "time", "is not before the end; allowed: below task.duration = " + number_text(task.duration_s) + " s");
      } else if (time && !(*time > before_s)) {
        readers[k].refuse("time", "is out of order; allowed: above the time of the via places before it, " +
                                      number_text(before_s) + " s");
      }
      if (time) before_s = *time;
    }
    readers[k].refuse_unknown_keys();
    if (position) task.via.push_back({*position, time});
  }
}

void read_keep_out(TableReader& table, Task& task) {
  const std::string allowed =
      fmt::format("an array of at most {} tables {{ center = [x, y], radius = r }}", kMostPlaces);
  auto readers = table.tables("keep_out", allowed);
  if (readers.size() > kMostPlaces) {
    table.refuse("keep_out", fmt::format("has {} entries; allowed: {}", readers.size(), allowed));
  }
  for (TableReader& reader : readers) {
    const auto center = reader.vector<2>("center", Range::any("m"));
    const auto radius = reader.number("radius", Range::positive("m"));
    reader.refuse_unknown_keys();
    if (center && radius) task.keep_out.push_back({*center, *radius});
  }
}

void read_follow(TableReader& table, Task& task) {
  table.know({"follow"});
  if (!table.has("follow")) return;
  TableReader follow = table.table("follow");
  if (!follow.present()) return;
  const auto points = read_places(follow, "points", 2);
  const auto tolerance = follow.number("tolerance", Range::positive("m"));
  follow.refuse_unknown_keys();
  if (points && tolerance) task.follow = Follow{*points, *tolerance};
}

void read_mass_position(TableReader& table, const sim::Scenario& scenario, Task& task) {
  table.know({"mass_position"});
  if (!table.has("mass_position")) return;
  const std::size_t count = scenario.masses.size();
  const auto positions = table.list("mass_position", count, count, Range::any("rad or m"));
  if (!positions) return;
  for (std::size_t i = 0; i < count; ++i) {
    const firmware::Rail& rail = scenario.masses[i].rail;
    if ((*positions)[i] >= rail.lower_end && (*positions)[i] <= rail.upper_end) continue;
    table.refuse(fmt::format("mass_position.{}", i),
                 fmt::format("is beyond the end of its rail; allowed: {} to {}", number_text(rail.lower_end),
                             number_text(rail.upper_end)));
  }
  task.mass_position = *positions;
}

double distance_to(const Follow& follow, const Eigen::Vector2d& place) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k + 1 < follow.points_m.size(); ++k) {
    const Eigen::Vector2d along = follow.points_m[k + 1] - follow.points_m[k];
    const double length = along.squaredNorm();
    const double part = length > 0 ? std::clamp((place - follow.points_m[k]).dot(along) / length, 0.0, 1.0) : 0;
    least = std::min(least, (place - follow.points_m[k] - part * along).norm());
  }
  return least;
}

// Refuses places of the task that contradict each other.
void check_places(TableReader& table, const sim::Scenario& scenario, const Task& task) {
  const double radius = scenario.ball.radius_m;
  const auto check = [&](const std::string& key, const std::string& what, const Eigen::Vector2d& place) {
    for (std::size_t c = 0; c < task.keep_out.size(); ++c) {
      const KeepOut& circle = task.keep_out[c];
      const double clear = circle.radius_m + radius, distance = (place - circle.center_m).norm();
      if (distance >= clear) continue;
      table.refuse(key, fmt::format("{} {:.4g} m from the center of keep_out.{}; allowed: at least its radius and the "
                                    "ball's, {:.4g} m",
                                    what, distance, c, clear));
    }
    if (task.follow && distance_to(*task.follow, place) > task.follow->tolerance_m) {
      table.refuse(key,
                   fmt::format("{} {:.4g} m from the path to follow; allowed: at most task.follow.tolerance = {:.4g} m",
                               what, distance_to(*task.follow, place), task.follow->tolerance_m));
    }
  };
  check("goal", "is", task.goal_m);
  const Eigen::Vector2d start = scenario.initial.position_W_m;
  check(task.keep_out.empty() ? "follow" : "keep_out", "contradicts the start, which is", start);
  for (std::size_t v = 0; v < task.via.size(); ++v)
    check(fmt::format("via.{}.position", v), "is", task.via[v].position_m);
}

// Refuses what the planner's model does not have.
void check_scenario(TableReader& root, const sim::Scenario& scenario) {
  const auto refuse = [&](const std::string& key, const std::string& why) { root.refuse(key, why); };
  if (scenario.masses.empty())
    refuse("mass", "is missing, so that nothing moves the ball; allowed in a task: at least one [[mass]]");
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Mass& mass = scenario.masses[i];
    if (!mass.motion.empty()) refuse(fmt::format("mass.{}.motion", i), "is what a plan gives; allowed in a task: none");
    if (!mass.trajectory.times_s.empty())
      refuse(fmt::format("mass.{}.trajectory", i), "cannot be planned; allowed in a task: a rail");
  }
  if (!scenario.force_table.times_s.empty())
    refuse("external_force", "changes with time; allowed in a task: a constant force");
  if (scenario.drag.coefficient_kgpm > 0) refuse("drag", "is not in the planner's model; allowed in a task: none");
  if (scenario.initial.height_m > 0) refuse("initial.height", "starts in flight; allowed in a task: 0");
  if (scenario.initial.has_velocity)
    refuse("initial.velocity", "starts sliding; allowed in a task: the rolling velocity");
  if (!(scenario.gravity_mps2 > 0)) refuse("gravity", "presses no ball to the floor; allowed in a task: > 0");
}

Task read_table(TableReader& root, const sim::Scenario& scenario) {
  Task task;
  root.know({"task"});
  TableReader table = root.table("task");
  if (!table.present()) {
    if (!root.has("task")) {
      root.refuse(
          "task",
          "is missing; allowed: a scenario with a [task], which says where the ball is to go (ballast run needs none)");
    }
    return task;
  }
  const auto goal = table.vector<2>("goal", Range::any("m"));
  const auto rest = table.boolean("at_rest", true);
  const auto duration = table.number("duration", Range::positive("s"));
  const auto objective = table.choice<Objective>("objective", {"friction", "time", "effort"}, Objective::kFriction);
  Range use = Range::between(0, 1);
  use.low_excluded = true;
  const auto friction_use = table.number("friction_use", use, task.friction_use);
  const auto avoid = table.boolean("avoid_resonance", true);
  Range margin = Range::between(0, 1);
  margin.high_excluded = true;
  const auto torque_margin = table.number("torque_margin", margin, task.torque_margin);
  if (goal) task.goal_m = *goal;
  if (rest) task.at_rest = *rest;
  if (duration) task.duration_s = *duration;
  if (objective) task.objective = *objective;
  if (friction_use) task.friction_use = *friction_use;
  if (avoid) task.avoid_resonance = *avoid;
  if (torque_margin) task.torque_margin = *torque_margin;
  read_via(table, task);
  read_keep_out(table, task);
  read_mass_position(table, scenario, task);
  read_follow(table, task);
  table.refuse_unknown_keys();
  if (duration && *duration < scenario.run.control_period_s) {
    table.refuse("duration", "is less than one control period; allowed: >= run.control_period = " +
                                 number_text(scenario.run.control_period_s) + " s");
  }
  if (goal) check_places(table, scenario, task);
  return task;
}

// The patches lie where they are: they are the map of the floor, which the planner has. What a patch leaves out is the
// believed floor's, as without [believed] it is the floor's.
sim::Scenario believed_with_patches(sim::Scenario scenario, const Toml& root) {
  std::vector<sim::SurfacePatch> patches = scenario.surface.patches;
  sim::Scenario believed = sim::as_believed(std::move(scenario));
  if (patches.empty()) return believed;
  const Toml* written = root.find("surface")->find("patch");
  sim::Surface& floor = believed.surface;
  for (std::size_t k = 0; k < patches.size(); ++k) {
    const Toml& own = written->items[k];
    sim::SurfacePatch& patch = patches[k];
    if (own.find("static_friction") == nullptr) patch.static_friction = floor.static_friction;
    if (own.find("kinetic_friction") == nullptr) patch.kinetic_friction = floor.kinetic_friction;
    patch.kinetic_friction = std::min(patch.kinetic_friction, patch.static_friction);
    if (own.find("rolling_resistance") == nullptr) patch.rolling_resistance = floor.rolling_resistance;
  }
  floor.patches = std::move(patches);
  return believed;
}

std::string whole_file(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

}  // namespace

std::optional<TaskFile> parse_task(const std::string& toml, const std::string& source,
                                   std::vector<sim::ScenarioError>& errors) {
  auto result = sim::parse_scenario(toml, source);
  Toml root;
  std::vector<sim::ScenarioError> unread;
  if (!sim::read_tree(toml, source, root, unread)) {
    errors = result.errors;
    return std::nullopt;
  }
  // A task may leave the scenario's own duration out, because it is the task's.
  const Toml* table = root.find("task");
  const Toml* duration = table == nullptr ? nullptr : table->find("duration");
  const bool number =
      duration != nullptr && (duration->kind == NodeKind::kFloat || duration->kind == NodeKind::kInteger);
  if (root.find("duration") == nullptr) {
    const double length_s = number && duration->number > 0 ? duration->number : 1;
    result = sim::parse_scenario(toml, source, {"duration=" + number_text(length_s)});
  }
  errors = result.errors;
  // The plan is made for the robot that is believed, on a floor with patches.
  if (result.ok()) result.scenario = believed_with_patches(std::move(result.scenario), root);
  TaskFile out;
  sim::ReadContext context{source, errors, result.warnings};
  TableReader reader(&root, "", context);
  out.task = read_table(reader, result.scenario);
  if (result.ok()) check_scenario(reader, result.scenario);
  std::stable_sort(errors.begin(), errors.end(), [](const auto& a, const auto& b) { return a.line < b.line; });
  if (!errors.empty()) return std::nullopt;
  out.scenario = std::move(result.scenario);
  return out;
}

std::optional<TaskFile> read_task(const std::filesystem::path& file, std::vector<sim::ScenarioError>& errors) {
  const auto result = sim::read_scenario(file);
  const bool unreadable =
      !result.errors.empty() && result.errors.front().key.empty() && result.errors.front().line == 0;
  if (unreadable) {
    errors = result.errors;
    return std::nullopt;
  }
  return parse_task(whole_file(file), file.string(), errors);
}

namespace {

// The creep rate that the planner rolls with. A smaller one would brake a slow ball faster than the parts of a step
// resolve (rollout.cpp), and tells rates apart that are hardly more than what counts as rest; the plant has the true
// one.
double resolved_creep_radps(const Problem& problem) {
  const firmware::BallParams& ball = problem.robot.ball;
  const double resistance = std::max(ball.rolling_resistance, problem.floor.greatest_rolling_resistance());
  const double steepness = std::max(resistance, 3 * ball.spin_friction_m / ball.radius_m);
  return std::max(ball.creep_radps, std::max(1e-3, 3e-3 * steepness) / time_unit_s(problem));
}

}  // namespace

Problem make_problem(const TaskFile& file) {
  Problem problem;
  const sim::Scenario& scenario = file.scenario;
  static_cast<void>(program::to_ball_params(scenario, problem.robot.ball));  // read_task() refuses what this refuses
  problem.floor = PatchedFloor(scenario.surface, scenario.ball.radius_m);
  if (resists(problem)) {
    problem.robot.ball.creep_radps = scenario.creep_radps();
    problem.robot.ball.creep_radps = resolved_creep_radps(problem);
  }
  problem.task = file.task;
  const auto& q = scenario.initial.orientation;
  problem.start.q = {q.w(), q.x(), q.y(), q.z()};
  problem.start.omega_B = sim::vec3(scenario.initial.angular_velocity_B_radps);
  problem.start_m = scenario.initial.position_W_m;
  problem.friction_limit =
      std::min(file.task.friction_use, scenario.envelope.friction_use) * problem.floor.reference_friction();
  problem.least_normal_n = scenario.envelope.min_normal_force_n;
  const bool driven = scenario.run.actuation == sim::Actuation::kStepper;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Mass& mass = scenario.masses[i];
    problem.start.position[i] = mass.initial_position;
    problem.start.velocity[i] = mass.initial_velocity;
    problem.metres_per_unit[i] = mass.metres_per_rail_unit();
    MassLimits& limits = problem.limits[i];
    limits.lower = mass.rail.lower_end;
    limits.upper = mass.rail.upper_end;
    if (!driven && !mass.motor_limited) continue;
    problem.robot.reflected_inertia[i] = mass.motor.rail_inertia();
    limits.speed = mass.motor.max_step_rate_hz / mass.motor.microsteps_per_rail_unit();
    limits.acceleration = mass.motor.max_acceleration;
    limits.jerk = mass.motor.max_jerk;
    limits.motor.emplace(mass.motor, 0, 0);
    const double swing_radps = mass.swing_radps();
    for (const int order : {1, 2}) {
      limits.resonant_speeds.push_back(order * swing_radps /
                                       (mass.motor.steps_per_revolution * mass.motor.shaft_ratio));
    }
  }
  return problem;
}

}  // namespace ballast::plan
