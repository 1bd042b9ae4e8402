#include "tools/plan/random_task.h"

#include <fmt/core.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/plan/plant_check.h"
#include "tools/plan/random_robot.h"
#include "tools/plan/read_task.h"
#include "tools/plan/sqp.h"

namespace ballast::plan {
namespace {

// Where the centre of mass is, from the geometric centre, when it hangs in equilibrium at `depth_m` from it: on the
// weight's line through the contact point, below the geometric centre. Not so far off: along the weight.
Eigen::Vector3d hanging_place(const firmware::BallParams& ball, double depth_m) {
  const Eigen::Vector3d down = ball.down_W;
  const double r = ball.radius_m, along = -down[2] * r, aside = down.head<2>().norm() * r;
  if (depth_m < aside) return down;
  const double up_m = along - std::sqrt(depth_m * depth_m - aside * aside);  // from the contact point
  return -r * Eigen::Vector3d::UnitZ() - up_m * down;
}

// [initial] with the attitude in which the centre of mass hangs below the geometric centre.
std::string hanging(const Problem& problem) {
  const firmware::BallParams& ball = problem.robot.ball;
  Eigen::Vector3d moment = ball.shell_mass_kg * ball.center_of_mass_B_m;
  double mass_kg = ball.shell_mass_kg;
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    mass_kg += ball.mass_kg[k];
    moment += ball.mass_kg[k] * firmware::evaluate<double>(ball.rail[k], problem.start.position[k]).position;
  }
  const Eigen::Vector3d place =
      slopes(ball) ? hanging_place(ball, moment.norm() / mass_kg) : Eigen::Vector3d(-Eigen::Vector3d::UnitZ());
  const Eigen::Quaterniond q = Eigen::Quaterniond::FromTwoVectors(moment, place);
  return fmt::format("[initial]\norientation = [{:.17g}, {:.17g}, {:.17g}, {:.17g}]\n", q.w(), q.x(), q.y(), q.z());
}

std::vector<double> random_motion(Random& random, const Problem& problem, const Grid& grid, double size) {
  const int n = problem.masses();
  std::vector<double> knots(static_cast<std::size_t>(grid.knots() * n), 0);
  for (int i = 0; i < n; ++i) {
    for (int wave = 1; wave <= 6; ++wave) {
      const double rate = wave * std::numbers::pi / grid.duration_s;
      const double travel =
          size * problem.robot.ball.radius_m / problem.metres_per_unit[i] * random.between(-1, 1) / wave;
      for (int j = 1; j + 1 < grid.knots(); ++j) {
        knots[static_cast<std::size_t>(j * n + i)] += travel * rate * rate * std::sin(rate * j * grid.piece_s());
      }
    }
  }
  return knots;
}

// Holds with room: f_s / N, and every limit that the task sets.
bool admissible(const Problem& problem, const PlantRun& run, const Grid& grid, const std::vector<double>& knots) {
  if (!run.rolled || run.nodes.size() != static_cast<std::size_t>(grid.nodes())) return false;
  if (run.extrema.mu_required_max.value > 0.9 * problem.friction_limit) return false;
  Rollout rollout(problem, grid);
  rollout.adopt(run.nodes);
  return judge(Transcription(problem, rollout), knots).limit <= 0;
}

// Deviation from rest at the end: the equalities of a task to rest without those of its goal.
Eigen::VectorXd unrest(const Transcription& transcription) {
  const auto equalities = transcription.equalities(false);
  Eigen::VectorXd left(static_cast<Eigen::Index>(equalities.size()) - 2);
  for (Eigen::Index k = 0; k < left.size(); ++k) left[k] = equalities[static_cast<std::size_t>(k + 2)].value;
  return left;
}

// Newton steps of the smallest change that take away what is left of rest, plus `correction`. False: it does not end.
bool take_unrest_away(const Problem& problem, const Grid& grid, const Eigen::VectorXd& correction,
                      std::vector<double>& knots) {
  const int n = problem.masses(), size = grid.knots() * n;
  Rollout rollout(problem, grid);
  const Transcription transcription(problem, rollout);
  for (int round = 0; round < 12; ++round) {
    if (!rollout.roll(knots)) return false;
    const Eigen::VectorXd left = unrest(transcription) + correction;
    if (left.cwiseAbs().maxCoeff() < 1e-6) return true;
    rollout.differentiate();
    const auto equalities = transcription.equalities(true);
    Eigen::MatrixXd by_knots = Eigen::MatrixXd::Zero(left.size(), size);
    for (Eigen::Index k = 0; k < left.size(); ++k) {
      Eigen::VectorXd row = Eigen::VectorXd::Zero(size);
      transcription.expand(equalities[static_cast<std::size_t>(k + 2)].form[0], 1, row.data());
      for (int v = 0; v < size; ++v) row[v] *= v < n || v >= size - n ? 0 : acceleration_unit(problem, v % n);
      by_knots.row(k) = row.transpose();
    }
    const Eigen::VectorXd step = by_knots.completeOrthogonalDecomposition().solve(-left);
    const double shorter = std::min(1.0, 0.3 / std::max(step.cwiseAbs().maxCoeff(), 1e-12));
    for (int v = n; v < size - n; ++v) {
      knots[static_cast<std::size_t>(v)] += shorter * step[v] * acceleration_unit(problem, v % n);
    }
  }
  return false;
}

// Bends a motion until ball and masses rest in equilibrium at its end, by the plant. The floor's moment fades at a high
// rate first, as the search has it.
bool bring_to_rest(const Problem& problem, const sim::Scenario& scenario, const Grid& grid,
                   std::vector<double>& knots) {
  constexpr double kRest = 1e-4;  // a third of what the search lets pass as rest
  Eigen::VectorXd correction = Eigen::VectorXd::Zero(5 + problem.masses());
  for (const double creep : {0.3, 0.1, 0.03, 0.01, 0.003}) {
    Problem fading = problem;
    double& rate_radps = fading.robot.ball.creep_radps;
    rate_radps = std::max(rate_radps, creep / time_unit_s(problem));
    if (!take_unrest_away(fading, grid, correction, knots)) return false;
  }
  for (int round = 0; round < 5; ++round) {
    if (!take_unrest_away(problem, grid, correction, knots)) return false;
    const PlantRun run = roll_by_plant(problem, scenario, grid, knots);
    if (!run.rolled || run.nodes.size() != static_cast<std::size_t>(grid.nodes())) return false;
    Rollout rolled(problem, grid), modelled(problem, grid);
    rolled.adopt(run.nodes);
    const Eigen::VectorXd left = unrest(Transcription(problem, rolled));
    if (left.cwiseAbs().maxCoeff() < kRest) return true;
    if (!modelled.roll(knots)) return false;
    correction = left - unrest(Transcription(problem, modelled));
  }
  return false;
}

Eigen::Vector2d place_of(const Node& node) { return {node.place_m[0], node.place_m[1]}; }

// A circle beside the path; empty if there is no room.
std::string circle_beside(Random& random, const PlantRun& run, double r) {
  const Eigen::Vector2d start = place_of(run.nodes.front()), along = place_of(run.nodes.back()) - start;
  for (int attempt = 0; attempt < 20; ++attempt) {
    const Eigen::Vector2d center =
        start + random.between(0.2, 0.8) * along + random.between(-1, 1) * Eigen::Vector2d(-along[1], along[0]);
    double clear = 1e300;
    for (const Node& node : run.nodes) clear = std::min(clear, (place_of(node) - center).norm());
    const double radius = std::min(clear - 1.05 * r, 2 * r);
    if (radius < 0.05 * r) continue;
    return fmt::format("{{ center = [{:.6g}, {:.6g}], radius = {:.6g} }}", center[0], center[1], radius);
  }
  return "";
}

std::string circles(Random& random, const PlantRun& run, double r) {
  std::string list;
  for (int k = 1 + random.pick(3); k > 0; --k) {
    const std::string circle = circle_beside(random, run, r);
    if (!circle.empty()) list += (list.empty() ? "" : ", ") + circle;
  }
  return list.empty() ? "" : fmt::format("keep_out = [ {} ]\n", list);
}

// One or two places on the path, with their times or without.
std::string vias(Random& random, const PlantRun& run, const Grid& grid) {
  std::string list;
  const int count = 1 + random.pick(2);
  for (int k = 0; k < count; ++k) {
    const int node = static_cast<int>((k + random.between(0.3, 0.7)) / count * grid.nodes());
    const Eigen::Vector2d via = place_of(run.nodes[static_cast<std::size_t>(node)]);
    const std::string time = random.coin() ? fmt::format(", time = {:.9g}", node * grid.step_s()) : "";
    list += fmt::format("{}{{ position = [{:.9g}, {:.9g}]{} }}", k == 0 ? "" : ", ", via[0], via[1], time);
  }
  return fmt::format("via = [ {} ]\n", list);
}

double distance_to_leg(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const Eigen::Vector2d& place) {
  const Eigen::Vector2d along = to - from;
  const double length = along.squaredNorm();
  const double part = length > 0 ? std::clamp((place - from).dot(along) / length, 0.0, 1.0) : 0;
  return (place - from - part * along).norm();
}

// A polyline through places of the path, as wide as the path needs and a little more.
std::string path_to_follow(const PlantRun& run, double r) {
  constexpr std::size_t kLegs = 6;
  std::vector<Eigen::Vector2d> points;
  for (std::size_t k = 0; k <= kLegs; ++k) points.push_back(place_of(run.nodes[k * (run.nodes.size() - 1) / kLegs]));
  double farthest = 0;
  for (const Node& node : run.nodes) {
    double nearest = 1e300;
    for (std::size_t k = 0; k < kLegs; ++k) {
      nearest = std::min(nearest, distance_to_leg(points[k], points[k + 1], place_of(node)));
    }
    farthest = std::max(farthest, nearest);
  }
  std::string list;
  for (const auto& p : points) list += fmt::format("{}[{:.9g}, {:.9g}]", list.empty() ? "" : ", ", p[0], p[1]);
  return fmt::format("follow = {{ points = [{}], tolerance = {:.6g} }}\n", list, 1.1 * farthest + 0.02 * r);
}

// Conditions on the way that the motion keeps.
std::string on_the_way(Random& random, const PlantRun& run, const Grid& grid, double r) {
  switch (random.pick(5)) {
    case 0:
    case 1:
      return circles(random, run, r);
    case 2:
    case 3:
      return vias(random, run, grid);
    default:
      return path_to_follow(run, r);
  }
}

std::string objective_text(Random& random) {
  const int k = random.pick(10);
  return fmt::format("objective = \"{}\"\n", k < 6 ? "friction" : k < 8 ? "time" : "effort");
}

std::string task_text(double goal_x, double goal_y, double duration_s, bool at_rest) {
  return fmt::format("[task]\ngoal = [{:.9g}, {:.9g}]\nduration = {:.9g}\nat_rest = {}\n", goal_x, goal_y, duration_s,
                     at_rest);
}

// The robot at rest, hanging, with a task that holds its place. `floor`: further lines of [surface].
std::string hung_robot(std::uint64_t seed, int number, int robot, const std::string& floor) {
  std::string text = fmt::format("name = \"task_{}\"\n", number) + random_robot(seed, robot) + floor;
  text += fmt::format("[run]\nactuation = \"{}\"\n", has_motors(robot) ? "stepper" : "prescribed");
  std::vector<sim::ScenarioError> errors;
  const auto draft = parse_task(text + task_text(0, 0, 1, false), "random task", errors);
  if (!draft) return errors.empty() ? "" : sim::to_string(errors.front());  // a bug: its text is no task
  return text + hanging(make_problem(*draft));
}

// From rest to rest along e1, which the first mass drives, slowly: nothing proves that it can be done.
std::string rest_to_rest(Random& random, const std::string& text, const Problem& problem) {
  const double r = problem.robot.ball.radius_m;
  const double duration_s = time_unit_s(problem) * random.between(30, 60);
  const double most = 0.15 * problem.friction_limit * problem.robot.ball.gravity_mps2 * duration_s * duration_s / 4;
  const double distance = std::min(random.between(0.5, 4) * r, most);
  return text + task_text(distance, 0, duration_s, true) + objective_text(random);
}

}  // namespace

std::optional<std::string> random_floor_task(std::uint64_t seed, int number, const RandomFloor& floor,
                                             std::string& why) {
  constexpr int kMostTries = 90, kFarTries = 75;  // the last ones take goals that are nearly reached already
  constexpr double kLeastWay = 0.3;               // of the radius
  Random random(seed * 104729 + static_cast<std::uint64_t>(number) + 1);
  const bool at_rest = number / 2 % 2 == 1;
  const std::string surface =
      fmt::format("rolling_resistance = {:.6g}\nslope = {{ angle = {:.17g}, downhill = {:.6g} }}\n",
                  floor.rolling_resistance, floor.slope_rad, random.between(-std::numbers::pi, std::numbers::pi));
  const std::string text = hung_robot(seed, number, 4 * number + 1, surface);
  std::vector<sim::ScenarioError> errors;
  const auto hung = parse_task(text + task_text(0, 0, 1, at_rest), "random task", errors);
  if (!hung) {
    why = errors.empty() ? text : sim::to_string(errors.front());
    return std::nullopt;
  }
  const Problem problem = make_problem(*hung);
  for (int attempt = 0; attempt < kMostTries; ++attempt) {
    const double size =
        attempt < kFarTries ? std::pow(10, random.between(-1, 0.3)) : std::pow(0.5, attempt - kFarTries);
    const double duration_s = time_unit_s(problem) * random.between(at_rest ? 20 : 8, 60);
    const Grid grid = make_grid(problem, duration_s, 48);
    std::vector<double> knots = random_motion(random, problem, grid, size);
    if (at_rest && !bring_to_rest(problem, hung->scenario, grid, knots)) continue;
    const PlantRun rolled = roll_by_plant(problem, hung->scenario, grid, knots);
    if (!admissible(problem, rolled, grid, knots)) continue;
    const Eigen::Vector2d goal = place_of(rolled.nodes.back());
    const double way_m = (goal - problem.start_m).norm();
    if (attempt < kFarTries && way_m < kLeastWay * problem.robot.ball.radius_m) continue;
    const std::string task = text + task_text(goal[0], goal[1], duration_s, at_rest) + objective_text(random);
    return number % 16 < 12 || at_rest ? task : task + on_the_way(random, rolled, grid, problem.robot.ball.radius_m);
  }
  why = fmt::format("none of {} random motions is admissible", kMostTries);
  return std::nullopt;
}

bool is_surely_possible(int number) { return number / kRandomRobots % 4 != 2 || number % kRandomRobots % 4 == 0; }

std::optional<std::string> random_task(std::uint64_t seed, int number, std::string& why) {
  constexpr int kMostTries = 60;  // the last one moves masses by 2e-6 of the first
  Random random(seed * 104729 + static_cast<std::uint64_t>(number) + 1);
  const std::string text = hung_robot(seed, number, number % kRandomRobots, "");
  std::vector<sim::ScenarioError> errors;
  const auto hung = parse_task(text + task_text(0, 0, 1, false), "random task", errors);
  if (!hung) {
    why = errors.empty() ? text : sim::to_string(errors.front());
    return std::nullopt;
  }
  const Problem problem = make_problem(*hung);
  if (!is_surely_possible(number)) return rest_to_rest(random, text, problem);
  double size = 1;
  for (int attempt = 0; attempt < kMostTries; ++attempt, size *= 0.8) {
    const double duration_s = time_unit_s(problem) * random.between(8, 60);
    const Grid grid = make_grid(problem, duration_s, 48);
    const std::vector<double> knots = random_motion(random, problem, grid, size);
    const PlantRun rolled = roll_by_plant(problem, hung->scenario, grid, knots);
    if (!admissible(problem, rolled, grid, knots)) continue;
    const Eigen::Vector2d goal = place_of(rolled.nodes.back());
    std::string task = text + task_text(goal[0], goal[1], duration_s, false) + objective_text(random);
    if (number / kRandomRobots % 2 == 1) task += on_the_way(random, rolled, grid, problem.robot.ball.radius_m);
    if (random.pick(4) > 0) return task;
    std::string places;
    for (int i = 0; i < problem.masses(); ++i) {
      const double place = rolled.nodes.back().state.position[static_cast<std::size_t>(i)];
      places += fmt::format("{}{:.9g}", i == 0 ? "" : ", ", place);
    }
    return task + fmt::format("mass_position = [{}]\n", places);
  }
  why = fmt::format("none of {} random motions is admissible", kMostTries);
  return std::nullopt;
}

}  // namespace ballast::plan
