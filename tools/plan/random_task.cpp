#include "tools/plan/random_task.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "tools/plan/plant_check.h"
#include "tools/plan/read_task.h"

namespace ballast::plan {
namespace {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  bool coin() { return (engine_() >> 40 & 1) != 0; }

 private:
  std::mt19937_64 engine_;
};

std::string vector_text(double x, double y, double z) { return fmt::format("[{:.6g}, {:.6g}, {:.6g}]", x, y, z); }

// A ball of radius 1 in units with g = 1, as the paper's: two to four masses on great circles of any direction.
std::string paper_like(Random& random) {
  std::string text = fmt::format(
      "gravity = 1.0\n[ball]\nradius = 1.0\nmass = {:.4g}\ninertia = [{:.4g}, {:.4g}, {:.4g}]\n"
      "center_of_mass = [0, 0, {:.4g}]\n",
      random.between(0.8, 2), random.between(0.8, 1), random.between(0.9, 1.1), random.between(1, 1.2),
      random.between(-0.2, -0.03));
  const int masses = 2 + static_cast<int>(random.between(0, 2.999));
  for (int i = 0; i < masses; ++i) {
    text += fmt::format(
        "[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"circle\", radius = {:.4g}, direction = {{ azimuth = {:.4g}, "
        "elevation = "
        "{:.4g} }} }}\ninitial_position = {:.4g}\n",
        random.between(0.3, 1.2), random.between(0.6, 0.95), random.between(-3, 3), random.between(-1.2, 1.2),
        random.between(-3, 3));
  }
  return text;
}

// A ball one can hold: two driving rings and a steering ring, masses hanging at the bottom.
std::string desk_like(Random& random) {
  const double r = random.between(0.08, 0.2), shell = random.between(0.5, 1.5) * r / 0.15;
  const double inertia = 0.6 * shell * r * r, ring = random.between(0.5, 0.65) * r,
               apart = random.between(0.3, 0.45) * r;
  std::string text = fmt::format("gravity = 9.81\n[ball]\nradius = {:.4g}\nmass = {:.4g}\ninertia = {}\n", r, shell,
                                 vector_text(inertia, inertia, inertia));
  const double mass = random.between(0.2, 0.4) * shell;
  for (const int side : {-1, 1}) {
    text += fmt::format(
        "[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"circle\", radius = {:.4g}, center = [0, {:.4g}, 0], axes = [[0, "
        "0, -1], "
        "[1, 0, 0]] }}\n",
        mass, ring, side * apart);
  }
  text += fmt::format(
      "[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"circle\", radius = {:.4g}, center = [0, 0, {:.4g}], axes = [[0, 0, "
      "-1], [0, "
      "1, 0]] }}\n",
      random.between(0.7, 1.2) * mass, random.between(0.35, 0.5) * r, random.between(0, 0.2) * r);
  return text;
}

// Three weights on straight rails through the ball, low enough to be stable.
std::string line_like(Random& random) {
  const double r = random.between(0.1, 0.3), shell = random.between(0.5, 2);
  const double inertia = 0.5 * shell * r * r;
  std::string text = fmt::format(
      "gravity = 9.81\n[ball]\nradius = {:.4g}\nmass = {:.4g}\ninertia = {}\ncenter_of_mass = [0, "
      "0, {:.4g}]\n",
      r, shell, vector_text(inertia, inertia, inertia), -0.15 * r);
  const double low = -random.between(0.1, 0.3) * r;
  const char* directions[3] = {"[1, 0, 0]", "[0, 1, 0]", "[1, 1, 0]"};
  for (int i = 0; i < 3; ++i) {
    text +=
        fmt::format("[[mass]]\nmass = {:.4g}\nrail = {{ shape = \"line\", origin = [0, 0, {:.4g}], direction = {} }}\n",
                    random.between(0.2, 0.4) * shell, low * (1 + 0.3 * i), directions[i]);
  }
  return text;
}

std::string robot_text(std::uint64_t seed, int robot) {
  Random random(seed * 7919 + static_cast<std::uint64_t>(robot));
  const std::string text = robot % 3 == 0 ? paper_like(random) : robot % 3 == 1 ? desk_like(random) : line_like(random);
  return text + fmt::format("[surface]\nstatic_friction = {:.3g}\n", random.between(0.15, 0.5));
}

// [initial] with the attitude in which the centre of mass hangs below the geometric centre.
std::string hanging(const Problem& problem) {
  const firmware::BallParams& ball = problem.robot.ball;
  Eigen::Vector3d moment = ball.shell_mass_kg * ball.center_of_mass_B_m;
  for (int i = 0; i < ball.mass_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    moment += ball.mass_kg[k] * firmware::evaluate<double>(ball.rail[k], problem.start.position[k]).position;
  }
  const Eigen::Quaterniond q = Eigen::Quaterniond::FromTwoVectors(moment, -Eigen::Vector3d::UnitZ());
  return fmt::format("[initial]\norientation = [{:.17g}, {:.17g}, {:.17g}, {:.17g}]\n", q.w(), q.x(), q.y(), q.z());
}

std::string task_head(double goal_x, double goal_y, double duration_s) {
  return fmt::format("[task]\ngoal = [{:.9g}, {:.9g}]\nduration = {:.6g}\nat_rest = false\n", goal_x, goal_y,
                     duration_s);
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

bool admissible(const Problem& problem, const PlantRun& run, const Grid& grid) {
  if (!run.rolled || run.nodes.size() != static_cast<std::size_t>(grid.nodes())) return false;
  if (run.extrema.mu_required_max.value > 0.9 * problem.friction_limit) return false;
  for (const Node& node : run.nodes) {
    for (int i = 0; i < problem.masses(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double room = 0.02 * (problem.limits[k].upper - problem.limits[k].lower);
      if (std::isfinite(room) && (node.state.position[k] < problem.limits[k].lower + room ||
                                  node.state.position[k] > problem.limits[k].upper - room)) {
        return false;
      }
    }
  }
  return true;
}

Eigen::Vector2d place_of(const Node& node) { return {node.place_m[0], node.place_m[1]}; }

// Circles beside the path, and via places on it.
std::string extras(Random& random, const PlantRun& run, const Grid& grid, double r) {
  const Eigen::Vector2d start = place_of(run.nodes.front()), goal = place_of(run.nodes.back());
  std::string text;
  if (random.coin()) {
    for (int attempt = 0; attempt < 20 && text.empty(); ++attempt) {
      const Eigen::Vector2d along = goal - start;
      const Eigen::Vector2d center =
          start + random.between(0.2, 0.8) * along + random.between(-1, 1) * Eigen::Vector2d(-along[1], along[0]);
      double clear = 1e300;
      for (const Node& node : run.nodes) clear = std::min(clear, (place_of(node) - center).norm());
      const double radius = std::min(clear - 1.05 * r, 2 * r);
      if (radius > 0.05 * r) {
        text = fmt::format("keep_out = [ {{ center = [{:.6g}, {:.6g}], radius = {:.6g} }} ]\n", center[0], center[1],
                           radius);
      }
    }
  }
  if (!text.empty()) return text;
  const int node = static_cast<int>(random.between(0.3, 0.7) * grid.nodes());
  const Eigen::Vector2d via = place_of(run.nodes[static_cast<std::size_t>(node)]);
  const std::string time = random.coin() ? fmt::format(", time = {:.9g}", node * grid.step_s()) : "";
  return fmt::format("via = [ {{ position = [{:.9g}, {:.9g}]{} }} ]\n", via[0], via[1], time);
}

}  // namespace

std::string random_task(std::uint64_t seed, int number) {
  const int robot = number % kRandomRobots;
  Random random(seed * 104729 + static_cast<std::uint64_t>(number) + 1);
  std::string text = fmt::format("name = \"task_{}\"\n", number) + robot_text(seed, robot);
  text += "[run]\nactuation = \"prescribed\"\n";
  std::vector<sim::ScenarioError> errors;
  const auto draft = parse_task(text + task_head(1, 1, 1), "random task", errors);
  if (!draft) return errors.empty() ? "" : sim::to_string(errors.front());  // a bug: its text is no task
  Problem problem = make_problem(*draft);
  text += hanging(problem);
  const auto hung = parse_task(text + task_head(1, 1, 1), "random task", errors);
  problem = make_problem(*hung);
  for (double size = 1;; size *= 0.8) {
    const double duration_s = time_unit_s(problem) * random.between(15, 60);
    const Grid grid = make_grid(problem, duration_s, 48);
    const std::vector<double> knots = random_motion(random, problem, grid, size);
    const PlantRun rolled = roll_by_plant(problem, hung->scenario, grid, knots);
    if (!admissible(problem, rolled, grid)) continue;
    const Eigen::Vector2d goal = place_of(rolled.nodes.back());
    const std::string more =
        number / kRandomRobots % 2 == 1 ? extras(random, rolled, grid, problem.robot.ball.radius_m) : "";
    return text + task_head(goal[0], goal[1], duration_s) + more;
  }
}

}  // namespace ballast::plan
