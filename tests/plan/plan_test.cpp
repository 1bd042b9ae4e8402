// Plans of small tasks: each is checked against a run of the file as it would be written.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <set>

#include "tests/plan/desk_task.h"
#include "tests/plan/task_set.h"
#include "tools/ballast/stepper_run.h"
#include "tools/plan/alternatives.h"
#include "tools/plan/bounds.h"
#include "tools/plan/random_robot.h"
#include "tools/plan/random_task.h"
#include "tools/plan/transcription.h"
#include "tools/plan/write_plan.h"

namespace ballast::plan {
namespace {

const std::string kFloor = "static_friction = 0.5\n", kRobot = desk_task(kFloor, "");

struct Planned {
  std::optional<TaskFile> task;
  Problem problem;
  Outcome outcome;
  sim::Scenario written;
  std::vector<Node> nodes;  // of the plant, every 5 ms
};

std::string random_toml(std::uint64_t seed, int number) {
  std::string why;
  const auto toml = random_task(seed, number, why);
  EXPECT_TRUE(toml) << why;
  return toml.value_or("");
}

enum class Expect { kFound, kAnything };

// Plans, checks what every plan has to keep, and rolls it.
Planned plan_of(const std::string& toml, Expect expect = Expect::kFound) {
  Planned p;
  std::vector<sim::ScenarioError> errors;
  p.task = parse_task(toml, "task.toml", errors);
  EXPECT_TRUE(p.task) << errors_of(toml);
  if (!p.task) return p;
  p.problem = make_problem(*p.task);
  p.outcome = search(p.problem, p.task->scenario, {});
  if (expect == Expect::kFound) {
    EXPECT_EQ(p.outcome.status, Status::kFound) << p.outcome.binding;
  }
  if (!p.outcome.plan) return p;
  const auto read = sim::parse_scenario(plan_toml(toml, *p.task, *p.outcome.plan), "plan.toml");
  EXPECT_TRUE(read.ok()) << (read.ok() ? "" : sim::to_string(read.errors.front()));
  p.written = read.scenario;
  p.written.run.actuation = sim::Actuation::kPrescribed;
  sim::Plant plant(p.written);
  const int steps = static_cast<int>(std::ceil(p.written.duration_s / 0.005));
  for (int k = 0; k <= steps; ++k) {
    plant.advance(p.written.duration_s * k / steps, {});
    Node node{};
    const auto s = plant.sample();
    node.place_m = {s.position_W_m[0], s.position_W_m[1]};
    for (std::size_t i = 0; i < 3; ++i) {
      node.state.position[i] = s.mass_position[i];
      node.state.velocity[i] = s.mass_velocity[i];
    }
    node.state.omega_B = sim::vec3(s.angular_velocity_B_radps);
    p.nodes.push_back(node);
  }
  EXPECT_EQ(plant.end(), sim::PhysicsEnd::kNone);
  const double claim = p.outcome.plan->run.extrema.mu_required_max.value;
  EXPECT_NEAR(plant.extrema().mu_required_max.value, claim, 1e-4 * claim);
  EXPECT_LE(claim, p.problem.friction_limit);
  const Eigen::Vector2d end = plant.sample().position_W_m.head<2>();
  EXPECT_LT((end - p.task->task.goal_m).norm(), 1e-3);
  return p;
}

double least_distance(const Planned& p, const Eigen::Vector2d& place) {
  double least = 1e9;
  for (const Node& node : p.nodes) {
    least = std::min(least, (Eigen::Vector2d(node.place_m[0], node.place_m[1]) - place).norm());
  }
  return least;
}

TEST(Plan, RestToRestNeedsLittleMoreThanTheBound) {
  const Planned p = plan_of(kRobot + "goal = [0.5, 0.0]\nduration = 6.0\n");
  ASSERT_TRUE(p.outcome.plan);
  const double bound = 4 * 0.5 / (9.81 * 36);
  EXPECT_LT(p.outcome.plan->run.extrema.mu_required_max.value, 1.4 * bound);  // the bar; 1.15 was reached
  const Node& end = p.nodes.back();
  const double spin = std::sqrt(sim::dot(end.state.omega_B, end.state.omega_B));
  EXPECT_LT(spin, 1e-3);  // rad/s: 0.15 mm/s
  for (std::size_t i = 0; i < 3; ++i) EXPECT_LT(std::abs(end.state.velocity[i]), 1e-3);
}

TEST(Plan, StaysAtRestAfterTheEnd) {
  const std::string toml = kRobot + "goal = [0.3, 0.1]\nduration = 6.0\n";
  const Planned p = plan_of(toml);
  ASSERT_TRUE(p.outcome.plan);
  sim::Scenario longer = p.written;
  longer.duration_s = 16;
  sim::Plant plant(longer);
  plant.advance(16, {});
  // The speed that is left, 3e-4 sqrt(g r), takes it at most 3.6 mm in 10 s.
  EXPECT_LT((plant.sample().position_W_m.head<2>() - Eigen::Vector2d(0.3, 0.1)).norm(), 4e-3);
}

// A task to rest whose ball may still turn about the vertical.
struct Turning {
  explicit Turning(double rest_spin_radps) : file(read_task(kRobot + "goal = [0.3, 0.1]\nduration = 6.0\n")) {
    file.scenario.initial.angular_velocity_B_radps.z() = 0.06;
    file.task.rest_spin_radps = rest_spin_radps;
    problem = make_problem(file);
  }
  TaskFile file;
  Problem problem;
};

TEST(Plan, MayKeepATurnAboutTheVertical) {
  const Turning turning(0.063);
  SearchOptions options;
  options.quick = true;
  const Outcome outcome = search(turning.problem, turning.file.scenario, options);
  ASSERT_EQ(outcome.status, Status::kFound) << outcome.binding;
  const RollingState& end = outcome.plan->run.nodes.back().state;
  const Vec up = to_body(end.q, {0, 0, 1});
  const double spin = dot(end.omega_B, up), whole = std::sqrt(dot(end.omega_B, end.omega_B));
  EXPECT_LE(std::abs(spin), 0.063 + 1e-3);  // a plan's tolerance of a limit, 1e-4 sqrt(g / r)
  EXPECT_LT(std::sqrt(std::max(0.0, whole * whole - spin * spin)), 3e-3);  // rad/s: 0.3 mm/s
}

// The conditions on the ball's turning at the end, and their derivatives by the knots.
TEST(Plan, RestWithATurnHasTheDerivativesOfItsConditions) {
  const Turning turning(0.063);
  const Grid grid{6, 8, 400};  // fine: derivatives are those of the motion, not of its steps
  std::vector<double> knots(static_cast<std::size_t>(3 * grid.knots()));
  for (std::size_t v = 0; v < knots.size(); ++v) knots[v] = std::sin(1.7 * static_cast<double>(v));
  struct Condition {
    double value;
    std::vector<double> slope;
  };
  const auto conditions = [&](const std::vector<double>& at) {
    Rollout rollout(turning.problem, grid);
    EXPECT_TRUE(rollout.roll(at));
    rollout.differentiate();
    const Transcription transcription(turning.problem, rollout);
    std::vector<Condition> out;
    const auto note = [&](double value, const NodeForm& form) {
      out.push_back({value, std::vector<double>(at.size(), 0)});
      transcription.expand(form, 1, out.back().slope.data());
    };
    for (const auto& e : transcription.equalities(true)) {
      if (e.kind.kind == EqualityKind::kSpin) note(e.value, e.form[0]);
    }
    transcription.limits(true, [&](const Limit& limit, const NodeForm& form) {
      if (limit.kind == LimitKind::kRestSpin) note(limit.value, form);
    });
    return out;
  };
  const auto here = conditions(knots);
  ASSERT_EQ(here.size(), 3U);
  constexpr double kStep = 1e-5;
  for (const std::size_t v : {std::size_t{3}, std::size_t{7}, std::size_t{14}, knots.size() - 1}) {
    std::vector<double> more = knots, less = knots;
    more[v] += kStep;
    less[v] -= kStep;
    const auto above = conditions(more), below = conditions(less);
    for (std::size_t k = 0; k < here.size(); ++k) {
      const double slope = (above[k].value - below[k].value) / (2 * kStep);
      EXPECT_NEAR(here[k].slope[v], slope, 1e-6 * (1 + std::abs(slope))) << "condition " << k << ", knot " << v;
    }
  }
}

TEST(Plan, PassesViaPlaces) {
  const Planned p = plan_of(kRobot +
                            "goal = [0.5, 0.0]\nduration = 8.0\n"
                            "via = [ { position = [0.2, 0.05] }, { position = [0.4, 0.03], time = 6.0 } ]\n");
  ASSERT_TRUE(p.outcome.plan);
  EXPECT_LT(least_distance(p, {0.2, 0.05}), 1.5e-3);  // samples are 5 ms apart
  const std::size_t at = static_cast<std::size_t>(std::lround(6.0 / 8.0 * static_cast<double>(p.nodes.size() - 1)));
  EXPECT_LT(std::hypot(p.nodes[at].place_m[0] - 0.4, p.nodes[at].place_m[1] - 0.03), 1e-3);
}

TEST(Plan, StaysOutOfCircles) {
  const Planned p = plan_of(kRobot +
                            "goal = [1.0, 0.0]\nduration = 10.0\nat_rest = false\n"
                            "keep_out = [ { center = [0.5, 0.16], radius = 0.05 } ]\n");
  ASSERT_TRUE(p.outcome.plan);
  EXPECT_GE(least_distance(p, {0.5, 0.16}), 0.2 - 1e-9);
}

TEST(Plan, FollowsAPath) {
  const Planned p = plan_of(kRobot +
                            "goal = [0.5, 0.05]\nduration = 8.0\n"
                            "follow = { points = [[0, 0], [0.25, 0.05], [0.5, 0.05]], tolerance = 0.01 }\n");
  ASSERT_TRUE(p.outcome.plan);
  for (const Node& node : p.nodes) {
    const double y = std::min(0.2 * std::max(node.place_m[0], 0.0), 0.05);
    EXPECT_LT(std::abs(node.place_m[1] - y), 0.0103);  // measured across, not normal to, the first leg
  }
}

// Paths that the free motion leaves by far more than the tolerance, straight and with sharp corners: the search has to
// come nearer step by step from either side of the path.
TEST(Plan, FollowsPathsFarFromTheFreeMotion) {
  const char* paths[] = {
      "goal = [1.0, 0.5]\nduration = 12.0\nfollow = { points = [[0, 0], [0.5, 0.25], [1.0, 0.5]], tolerance = 0.03 }\n",
      "goal = [0.5, 0.2]\nduration = 10.0\nfollow = { points = [[0, 0], [0.5, 0], [0.5, 0.2]], tolerance = 0.03 }\n",
      "goal = [0.6, 0]\nduration = 8.0\nfollow = { points = [[0, 0], [0.2, 0.1], [0.4, -0.1], [0.6, 0]], tolerance = "
      "0.03 }\n"};
  for (const char* path : paths) {
    SCOPED_TRACE(path);
    const Planned p = plan_of(kRobot + path);
    if (!p.outcome.plan) continue;
    const std::vector<Eigen::Vector2d>& points = p.task->task.follow->points_m;
    for (const Node& node : p.nodes) {
      const Eigen::Vector2d place(node.place_m[0], node.place_m[1]);
      double nearest = 1e9;
      for (std::size_t k = 0; k + 1 < points.size(); ++k) {
        const Eigen::Vector2d along = points[k + 1] - points[k];
        const double part = std::clamp((place - points[k]).dot(along) / along.squaredNorm(), 0.0, 1.0);
        nearest = std::min(nearest, (place - points[k] - part * along).norm());
      }
      EXPECT_LE(nearest, 0.03 + 1e-9);
    }
  }
}

TEST(Plan, PutsMassesWhereTheyAreToBe) {
  const Planned p =
      plan_of(kRobot + "goal = [0.3, 0.0]\nduration = 6.0\nmass_position = [0.2, -0.2, 0.0]\nat_rest = false\n");
  ASSERT_TRUE(p.outcome.plan);
  EXPECT_NEAR(p.nodes.back().state.position[0], 0.2, 1e-3);
  EXPECT_NEAR(p.nodes.back().state.position[1], -0.2, 1e-3);
}

TEST(Plan, TimeAndEffortAreObjectives) {
  const std::string floor = "[surface]\nstatic_friction = 0.5";
  std::string robot = kRobot;
  robot.replace(robot.find(floor), floor.size(), "[surface]\nstatic_friction = 0.02");
  const Planned fast = plan_of(robot + "goal = [0.5, 0.0]\nduration = 8.0\nobjective = \"time\"\n");
  ASSERT_TRUE(fast.outcome.plan);
  const double bound_s = std::sqrt(4 * 0.5 / (9.81 * 0.8 * 0.02));  // 3.6 s
  EXPECT_LT(fast.outcome.plan->grid.duration_s, 1.3 * bound_s);
  const Planned calm = plan_of(robot + "goal = [0.5, 0.0]\nduration = 8.0\nobjective = \"effort\"\n");
  const Planned smooth = plan_of(robot + "goal = [0.5, 0.0]\nduration = 8.0\n");
  ASSERT_TRUE(calm.outcome.plan && smooth.outcome.plan);
  const auto effort = [](const Plan& plan) {
    double sum = 0;
    for (const double a : plan.knots) sum += a * a;
    return sum;
  };
  EXPECT_LT(effort(*calm.outcome.plan), effort(*smooth.outcome.plan));
}

// A sample of what plan_tasks measures: 20 of the committed tasks, from every block of them, that a motion has shown to
// be possible. 95 % have to be found.
TEST(Plan, RandomTasksAreFound) {
  constexpr std::size_t kBlock = 50;
  std::string why;
  const std::vector<SetTask> tasks = read_task_set(BALLAST_TASK_SET, why);
  ASSERT_EQ(tasks.size(), 1000u) << why;
  int found = 0, planned = 0;
  for (std::size_t block = 0; block < tasks.size() / kBlock; ++block) {
    std::size_t at = block * kBlock + block;
    while (at + 1 < (block + 1) * kBlock && !tasks[at].sure) ++at;
    ASSERT_TRUE(tasks[at].sure) << at;
    SCOPED_TRACE("task " + std::to_string(tasks[at].number));
    const Planned p = plan_of(tasks[at].toml, Expect::kAnything);
    EXPECT_NE(p.outcome.status, Status::kInfeasible) << p.outcome.binding;
    found += p.outcome.plan ? 1 : 0;
    ++planned;
  }
  EXPECT_GE(found, 0.95 * planned);
}

// A mass that turns between two nodes at the end of its rail has left the ball there in an earlier version.
TEST(Plan, MassesStayOnTheirRailsBetweenNodesToo) {
  std::string why;
  const std::vector<SetTask> tasks = read_task_set(BALLAST_TASK_SET, why);
  ASSERT_EQ(tasks.size(), 1000u) << why;
  static_cast<void>(plan_of(tasks[384].toml));  // expects a file that the reader takes
}

// The generator still makes the tasks of the set, so that a set of another seed is of the same kind. Sines may differ
// in their last bits between machines, so tasks are compared by their length.
TEST(Plan, TheCommittedSetIsWhatTheGeneratorMakes) {
  std::string why;
  const std::vector<SetTask> tasks = read_task_set(BALLAST_TASK_SET, why);
  ASSERT_EQ(tasks.size(), 1000u) << why;
  for (const std::size_t number : {0u, 57u, 101u, 455u, 999u}) {
    const std::string made = random_toml(1, static_cast<int>(number));
    EXPECT_EQ(tasks[number].toml.substr(0, tasks[number].toml.find("[task]")), made.substr(0, made.find("[task]")));
    EXPECT_NEAR(static_cast<double>(tasks[number].toml.size()), static_cast<double>(made.size()), 8);
  }
}

TEST(Plan, TheSameSeedGivesTheSamePlan) {
  const std::string toml = random_toml(1, 56);
  const Planned first = plan_of(toml), second = plan_of(toml);
  ASSERT_TRUE(first.outcome.plan && second.outcome.plan);
  EXPECT_EQ(plan_toml(toml, *first.task, *first.outcome.plan), plan_toml(toml, *second.task, *second.outcome.plan));
}

// A task that no motion can do is refused by a bound, without a search.
TEST(Plan, RefusesTheImpossibleAtOnce) {
  const auto with = [](const std::string& old, const std::string& now) {
    std::string robot = kRobot;
    robot.replace(robot.find(old), old.size(), now);
    return robot;
  };
  std::string stuck = with("\"prescribed\"", "\"stepper\""), slow = stuck;
  for (std::size_t at = 0; (at = stuck.find("rail =", at)) != std::string::npos; at += 100) {
    stuck.insert(at, "motor = { preset = \"nema17\", gear_ratio = 4, max_acceleration = 1e-9 }\n");
  }
  for (std::size_t at = 0; (at = slow.find("rail =", at)) != std::string::npos; at += 100) {
    slow.insert(at, "motor = { preset = \"nema17\", gear_ratio = 4, max_step_rate = 10 }\n");
  }
  const std::string ice = with("static_friction = 0.5", "static_friction = 0.001");
  const std::pair<std::string, const char*> impossible[] = {
      {kRobot + "goal = [50, 0]\nduration = 3.0\n", "in that time the ball gets at most"},
      {kRobot + "goal = [50, 0]\nduration = 6.0\n", "friction stands in the way"},
      {kRobot + "goal = [100, 0]\nduration = 6.0\nat_rest = false\n", "friction stands in the way"},
      {kRobot + "goal = [1, 0]\nduration = 6.0\nvia = [ { position = [0.5, 0], time = 0.1 } ]\n", "task.via.0"},
      {ice + "goal = [0.5, 0]\nduration = 6.0\n", "friction stands in the way"},
      {stuck + "goal = [0.5, 0]\nduration = 6.0\n", "max_acceleration"},
      {slow + "goal = [0.1, 0]\nduration = 6.0\nmass_position = [1, 0, 0]\n", "max_step_rate"},
  };
  for (const auto& [toml, words] : impossible) {
    std::vector<sim::ScenarioError> errors;
    const auto task = parse_task(toml, "task.toml", errors);
    ASSERT_TRUE(task) << errors_of(toml);
    const Outcome outcome = search(make_problem(*task), task->scenario, {});
    EXPECT_EQ(outcome.status, Status::kInfeasible) << toml;
    EXPECT_EQ(outcome.iterations, 0) << toml;
    EXPECT_FALSE(outcome.plan);
    EXPECT_NE(outcome.binding.find(words), std::string::npos) << outcome.binding;
  }
}

// Friction between the bound and what a motion needs: no plan, and alternatives that no bound contradicts.
TEST(Plan, NamesWhatCanBeHadInstead) {
  std::string toml = kRobot + "goal = [0.5, 0.0]\nduration = 6.0\n";
  const std::string floor = "static_friction = 0.5";
  toml.replace(toml.find(floor), floor.size(), "static_friction = 0.0074");  // 0.8 of it: 0.0059; the bound: 0.0057
  std::vector<sim::ScenarioError> errors;
  const auto task = parse_task(toml, "task.toml", errors);
  ASSERT_TRUE(task) << errors_of(toml);
  const Problem problem = make_problem(*task);
  SearchOptions options;
  options.most_iterations = 100;
  const Outcome outcome = search(problem, task->scenario, options);
  ASSERT_EQ(outcome.status, Status::kNotFound) << outcome.binding;
  EXPECT_TRUE(outcome.friction_alone) << outcome.binding;
  std::set<std::string> looked_for;
  const Alternatives found = find_alternatives(
      *task, outcome, options, [&](const std::string& what) { looked_for.insert(what.substr(0, what.find(':'))); });
  EXPECT_EQ(looked_for, (std::set<std::string>{"a floor that holds", "a longer duration", "a nearer goal"}));
  ASSERT_TRUE(found.duration_s && found.goal_m && found.static_friction);
  EXPECT_GE(*found.duration_s, reach_of_friction(problem, 6, true).least_duration_s(0.5, problem.friction_limit));
  EXPECT_LT(*found.duration_s, 6.0 * 1.2);  // 6.3 s was found
  EXPECT_LE(found.goal_m->norm(), reach_of_friction(problem, 6, true).at(problem.friction_limit) + 1e-3);
  EXPECT_GT(found.goal_m->norm(), 0.4);
  EXPECT_GT(*found.static_friction, 0.0074);
  EXPECT_LT(*found.static_friction, 1.4 * 0.0074);  // rest to rest needs at most 1.4 times the bound
  const std::string text = alternatives_text(*task, found);
  EXPECT_NE(text.find("a duration of"), std::string::npos) << text;
  EXPECT_NE(text.find("from the goal"), std::string::npos) << text;
  EXPECT_NE(text.find("mu_s = "), std::string::npos) << text;
  EXPECT_EQ(alternatives_text(*task, {}), "");
  options.stop = [] { return true; };
  EXPECT_EQ(alternatives_text(*task, find_alternatives(*task, outcome, options, [](const std::string&) {})), "");
}

// From the question on that is answered with yes, the search makes no iteration, and asks at most once for each of its
// loops that it leaves: starts, stages, rounds, rolls. It is ended before its first start, before its first iteration,
// among its iterations, and in the plant's rolls.
TEST(Plan, ASearchThatIsEndedLeavesAllItsLoops) {
  const std::string patch = "[[surface.patch]]\ncircle = { center = [0.25, 0], radius = 0.1 }\nstatic_friction = 0.3\n";
  const std::string text = desk_task(kFloor + "rolling_resistance = 0.01\n" + patch,
                                     "goal = [0.5, 0.0]\nduration = 6.0\nfollow = { points = [[0, 0], [0.5, 0]], "
                                     "tolerance = 0.05 }\n");
  const TaskFile task = read_task(text);
  for (const int yes_at : {1, 2, 40, 150}) {
    SCOPED_TRACE("question " + std::to_string(yes_at));
    int asked = 0, iterations = 0, late = 0;
    SearchOptions options;
    options.stop = [&] { return ++asked >= yes_at; };
    options.progress = [&](int, double, double, double) {
      ++iterations;
      late += asked >= yes_at ? 1 : 0;
    };
    const Outcome outcome = search(make_problem(task), task.scenario, options);
    EXPECT_EQ(late, 0);
    EXPECT_EQ(outcome.iterations, iterations);
    EXPECT_LE(asked - yes_at, 20);  // 1 to 10
    if (yes_at == 150) {
      EXPECT_LT(iterations, 100);  // the rest was asked in rolls
    }
    if (!outcome.plan) {
      EXPECT_TRUE(outcome.binding.starts_with("the search was ended before it had found one")) << outcome.binding;
    }
  }
}

// The words of a search that is ended say what its nearest motion does not meet.
TEST(Plan, ASearchThatIsEndedNamesWhatIsUnmet) {
  const TaskFile task = read_task(kRobot + "goal = [0.5, 0.0]\nduration = 6.0\n");
  int asked = 0;
  SearchOptions options;
  options.stop = [&] { return ++asked > 2; };
  const Outcome outcome = search(make_problem(task), task.scenario, options);
  ASSERT_FALSE(outcome.plan);
  EXPECT_TRUE(outcome.binding.starts_with("the search was ended before it had found one; so far ")) << outcome.binding;
  EXPECT_NE(outcome.binding.find("could not be met"), std::string::npos) << outcome.binding;
}

// The plant asks at each node, and in the roll that looks for slip on patches.
TEST(Plan, ARollOfThePlantEndsWhereItIsToStop) {
  const std::string patch = "[[surface.patch]]\ncircle = { center = [0.25, 0], radius = 0.1 }\nstatic_friction = 0.3\n";
  const TaskFile task = read_task(desk_task(kFloor + patch, "goal = [0.5, 0.0]\nduration = 6.0\n"));
  const Problem problem = make_problem(task);
  const Grid grid = make_grid(problem, 6, 32);
  const std::vector<double> knots(static_cast<std::size_t>(grid.knots() * problem.masses()), 0);
  int asked = 0;
  const PlantRun whole = roll_by_plant(problem, task.scenario, grid, knots, [&] { return ++asked < 0; });
  EXPECT_TRUE(whole.rolled);
  EXPECT_EQ(asked, 50 + grid.nodes());
  for (const int yes_at : {1, 20, 51, 70}) {
    int questions = 0;
    const PlantRun run = roll_by_plant(problem, task.scenario, grid, knots, [&] { return ++questions >= yes_at; });
    EXPECT_FALSE(run.rolled);
    EXPECT_LT(run.nodes.size(), 20u);
    EXPECT_LE(questions, yes_at + 1);
  }
}

std::string with_motors(std::string robot, const std::string& limits, bool steppers) {
  const std::string motor = "motor = { preset = \"nema17\", gear_ratio = 4, viscous_damping = 0.02, " + limits + " }\n";
  for (std::size_t at = 0; (at = robot.find("rail =", at)) != std::string::npos; at += motor.size() + 1) {
    robot.insert(at, motor);
  }
  const std::string prescribed = "\"prescribed\"";
  if (steppers) robot.replace(robot.find(prescribed), prescribed.size(), "\"stepper\"");
  return robot;
}

TEST(Plan, ARunWithMotorsEndsAtTheTickWhereItIsToStop) {
  const TaskFile task = read_task(with_motors(kRobot + "goal = [0.5, 0.0]\nduration = 6.0\n", "microsteps = 16", true));
  const Problem problem = make_problem(task);
  const Grid grid = make_grid(problem, 6, 32);
  sim::Scenario moved = with_motion(task.scenario, grid,
                                    std::vector<double>(static_cast<std::size_t>(problem.masses() * grid.knots()), 0));
  moved.run.actuation = sim::Actuation::kStepper;
  for (const int yes_at : {1, 2, 30}) {
    int questions = 0, ticks = 0;
    const SteppedRun run = run_with_steppers(
        moved, [&] { return ++questions >= yes_at; }, [&](const sil::Lap&, const sim::Plant::Sample&) { ++ticks; });
    EXPECT_FALSE(run.result);
    EXPECT_NE(run.refusal.find("interrupted"), std::string::npos) << run.refusal;
    EXPECT_GE(questions, yes_at);
    EXPECT_LE(ticks, yes_at);
  }
}

// The robot on another floor; `surface`: further lines of [surface].
std::string on_floor(const std::string& surface, const std::string& task) { return desk_task(kFloor + surface, task); }

const std::string kSlope = "slope = { angle = 0.0523598775598, downhill = 0.7 }\n";  // 3 degrees

// The centre of mass off the weight's line through the contact point, and how far below the geometric centre it is,
// both in m.
std::pair<double, double> off_balance_m(const sim::Scenario& scenario, const sim::Plant::Sample& at) {
  Eigen::Vector3d moment = scenario.ball.mass_kg * scenario.ball.center_of_mass_B_m;
  double mass_kg = scenario.ball.mass_kg;
  for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
    const sim::Mass& mass = scenario.masses[i];
    moment += mass.mass_kg * firmware::evaluate<double>(mass.rail, at.mass_position[i]).position;
    mass_kg += mass.mass_kg;
  }
  const double slope = scenario.surface.slope_rad, downhill = scenario.surface.downhill_rad;
  const Eigen::Vector3d down(std::sin(slope) * std::cos(downhill), std::sin(slope) * std::sin(downhill),
                             -std::cos(slope));
  const Eigen::Vector4d q = at.orientation;
  const Eigen::Vector3d center = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * (moment / mass_kg);
  const Eigen::Vector3d from_contact = center + scenario.ball.radius_m * Eigen::Vector3d::UnitZ();
  return {from_contact.cross(down).norm(), center.dot(down)};
}

// The ball starts at no equilibrium of the slope. At the end it is in one, and stays.
TEST(PlanOnRealFloors, RestsInEquilibrium) {
  for (const char* resistance : {"", "rolling_resistance = 0.02\nspin_friction = 0.001\n"}) {
    SCOPED_TRACE(resistance);
    const Planned p = plan_of(on_floor(kSlope + resistance, "goal = [0.3, 0.1]\nduration = 6.0\n"));
    ASSERT_TRUE(p.outcome.plan);
    const sim::Plant::Sample& end = p.outcome.plan->run.final;
    const auto [off_m, below_m] = off_balance_m(p.written, end);
    EXPECT_LT(off_m, 3e-4 * p.written.ball.radius_m);  // what counts as rest
    EXPECT_GT(below_m, 0);
    EXPECT_LT(end.angular_velocity_B_radps.norm(), 4e-4 * std::sqrt(9.81 / 0.15));
    EXPECT_GE(p.outcome.plan->run.extrema.mu_required_max.value, std::tan(3 * std::numbers::pi / 180) * (1 - 1e-3));
    sim::Scenario longer = p.written;
    longer.duration_s = 16;
    sim::Plant plant(longer);
    plant.advance(16, {});
    // The speed that is left, 3e-4 sqrt(g r), takes it at most 3.6 mm in 10 s.
    EXPECT_LT((plant.sample().position_W_m.head<2>() - Eigen::Vector2d(0.3, 0.1)).norm(), 4e-3);
  }
}

// Where a floor resists a little, the solver ended beside rest: the first of these took 1,379 iterations to a plan that
// needs 0.116, and the second had none after 2,000.
TEST(PlanOnRealFloors, RestsOnFloorsThatResistALittle) {
  for (const auto& [resistance, steppers] : {std::pair("0.007", false), std::pair("0.01", true)}) {
    SCOPED_TRACE(std::string(resistance) + (steppers ? ", steppers" : ""));
    const std::string text = on_floor(std::string("rolling_resistance = ") + resistance + "\n",
                                      "goal = [0.5, 0.0]\nduration = 6.0\navoid_resonance = false\n");
    const Planned p = plan_of(steppers ? with_motors(text, "microsteps = 16", true) : text);
    ASSERT_TRUE(p.outcome.plan);
    EXPECT_LT(p.outcome.iterations, 400);  // 41 and 61
    EXPECT_LT(p.outcome.plan->run.extrema.mu_required_max.value,
              2 * 4 * 0.5 / (9.81 * 36));  // 1.14 and 1.13 times the bound
    const sim::Plant::Sample& end = p.outcome.plan->run.final;
    EXPECT_LT(end.angular_velocity_B_radps.norm(), 4e-4 * std::sqrt(9.81 / 0.15));  // 3e-4 counts as rest, per axis
  }
}

// The robot's masses bring the centre of mass at most 0.0461 m from the geometric centre: straight down, with all three
// at their lowest, it is 0.28 (2 0.095 + 0.02) / 1.64 = 0.036 m below it. r sin(angle) is 0.0513 m at 20 degrees.
TEST(PlanOnRealFloors, RefusesRestWhereThereIsNone) {
  const std::string task = "goal = [0.1, 0]\nduration = 6.0\n", steep = "slope = { angle = 0.349 }\n";
  const auto with_force = [&](const std::string& surface, const char* force) {
    return "external_force = " + std::string(force) + "\n" + on_floor(surface, task);
  };
  const std::pair<std::string, const char*> impossible[] = {
      {on_floor(steep, task), "centre of mass"},
      {on_floor(steep + "rolling_resistance = 0.5\n", task), "centre of mass"},  // it holds no ball for good
      {on_floor("slope = { angle = 0.524 }\n", task), "friction does not hold"},
      {with_force("slope = { angle = 0.02 }\n", "[0, 0.1, 0]"), "spins the ball"},
  };
  for (const auto& [toml, words] : impossible) {
    Problem problem;
    const Outcome outcome = outcome_of(toml, problem);
    EXPECT_EQ(outcome.status, Status::kInfeasible) << toml;
    EXPECT_NE(outcome.binding.find(words), std::string::npos) << outcome.binding;
    EXPECT_NE(outcome.binding.find("task.at_rest"), std::string::npos) << outcome.binding;
  }
  const std::string possible[] = {on_floor("slope = { angle = 0.2 }\n", task),
                                  on_floor(steep, task + "at_rest = false\n"),
                                  with_force(steep, "[-4, 0, 0]"),  // holds the weight's part in the floor nearly alone
                                  with_force("slope = { angle = 0.02 }\n", "[0.1, 0, 0]")};
  for (const std::string& toml : possible) {
    std::vector<sim::ScenarioError> errors;
    const auto read = parse_task(toml, "task.toml", errors);
    ASSERT_TRUE(read) << errors_of(toml);
    const Problem problem = make_problem(*read);
    EXPECT_EQ(problem.task.at_rest ? no_rest(problem) : "", "") << toml;
  }
}

// No place of the masses that a random draw finds is beyond the bound. On circles and lines the bound is reached:
// slopes little steeper than the farthest of 5,000 draws allows are refused.
TEST(PlanOnRealFloors, RefusalsOfRestAreSound) {
  int refused = 0, tried = 0;
  for (int robot = 0; robot < 24; ++robot) {
    SCOPED_TRACE("seed 1, robot " + std::to_string(robot));
    std::vector<sim::ScenarioError> errors;
    const auto task = parse_task("name = \"rest\"\n" + random_robot(1, robot) +
                                     "[run]\nactuation = \"prescribed\"\n[task]\ngoal = [0, 0]\nduration = 1\n",
                                 "task", errors);
    ASSERT_TRUE(task) << sim::to_string(errors.front());
    Problem problem = make_problem(*task);
    problem.friction_limit = std::numeric_limits<double>::infinity();
    firmware::BallParams& ball = problem.robot.ball;
    Random random(static_cast<std::uint64_t>(robot));
    double farthest_m = 0;
    for (int draw = 0; draw < 5000; ++draw) {
      Eigen::Vector3d moment = ball.shell_mass_kg * ball.center_of_mass_B_m;
      double mass_kg = ball.shell_mass_kg;
      for (std::size_t i = 0; i < task->scenario.masses.size(); ++i) {
        const firmware::Rail& rail = ball.rail[i];
        const bool ends = std::isfinite(rail.lower_end);
        const double position = ends ? random.between(rail.lower_end, rail.upper_end) : random.between(-10, 10);
        moment += ball.mass_kg[i] * firmware::evaluate<double>(rail, position).position;
        mass_kg += ball.mass_kg[i];
      }
      farthest_m = std::max(farthest_m, moment.norm() / mass_kg);
    }
    const auto on_slope = [&](double sine) {
      ball.down_W = firmware::Vector3(sine, 0, -std::sqrt(1 - sine * sine));
      return no_rest(problem);
    };
    EXPECT_EQ(on_slope(0.999 * farthest_m / ball.radius_m), "");
    const double steeper = 1.2 * farthest_m / ball.radius_m;
    if (robot % 4 == 3 || steeper >= 1) continue;
    ++tried;
    refused += on_slope(steeper).empty() ? 0 : 1;
  }
  EXPECT_GT(tried, 10);
  EXPECT_EQ(refused, tried);
}

TEST(PlanOnRealFloors, TheBelievedFloorIsPlannedOn) {
  const std::string task = "goal = [0.1, 0]\nduration = 4.0\n";
  const std::string believed =
      "[believed.surface]\nrolling_resistance = 0.03\nslope = { angle = 0.02, downhill = 0.0 }\n";
  std::string toml = on_floor(kSlope, task);
  toml.insert(toml.find("[task]"), believed);
  std::vector<sim::ScenarioError> errors;
  const auto read = parse_task(toml, "task.toml", errors);
  ASSERT_TRUE(read) << errors_of(toml);
  const firmware::BallParams ball = make_problem(*read).robot.ball;
  EXPECT_DOUBLE_EQ(ball.down_W[0], std::sin(0.02));
  EXPECT_EQ(ball.rolling_resistance, 0.03);
  const Outcome outcome = search(make_problem(*read), read->scenario, {});
  ASSERT_TRUE(outcome.plan) << outcome.binding;
  EXPECT_GE(outcome.plan->run.extrema.mu_required_max.value, std::tan(0.02) * (1 - 1e-3));
  EXPECT_LT(outcome.plan->run.extrema.mu_required_max.value, std::tan(3 * std::numbers::pi / 180));
}

// A sample of what `plan_tasks --slope` measures: to a place and to rest, prescribed and with steppers.
TEST(PlanOnRealFloors, RandomTasksAreFound) {
  constexpr std::uint64_t kSeed = 1;
  constexpr RandomFloor kSlope{3 * std::numbers::pi / 180, 0.02};
  for (const int number : {0, 1, 2, 3, 12, 14}) {
    SCOPED_TRACE("seed 1, task " + std::to_string(number));
    std::string why;
    const auto toml = random_floor_task(kSeed, number, kSlope, why);
    ASSERT_TRUE(toml) << why;
    const Planned p = plan_of(*toml);
    if (!p.outcome.plan) continue;
    const double distance_m = (p.task->task.goal_m - p.problem.start_m).norm();
    const Reach reach = reach_of_friction(p.problem, p.outcome.plan->grid.duration_s, p.task->task.at_rest);
    EXPECT_GE(reach.at(p.outcome.plan->run.extrema.mu_required_max.value), distance_m);
  }
}

// Motors too weak for a goal are named at once, each by the limit that stands in the way.
TEST(Plan, RefusesWhatMotorsCannotDoAtOnce) {
  const std::pair<const char*, const char*> weak[] = {{"max_step_rate = 100", "motor.max_step_rate"},
                                                      {"max_acceleration = 0.01", "motor.max_acceleration"},
                                                      {"max_step_rate = 6000, max_acceleration = 50", "motor."}};
  for (const auto& [limits, words] : weak) {
    SCOPED_TRACE(limits);
    const std::string toml = with_motors(kRobot, limits, true) + "goal = [8.0, 0]\nduration = 3.0\n";
    std::vector<sim::ScenarioError> errors;
    const auto task = parse_task(toml, "task.toml", errors);
    ASSERT_TRUE(task) << errors_of(toml);
    const Outcome outcome = search(make_problem(*task), task->scenario, {});
    EXPECT_EQ(outcome.status, Status::kInfeasible);
    EXPECT_EQ(outcome.iterations, 0);
    EXPECT_NE(outcome.binding.find(words), std::string::npos) << outcome.binding;
    EXPECT_NE(outcome.binding.find("takes at least"), std::string::npos) << outcome.binding;
  }
}

// The bounds are above everything that a motion reaches.
TEST(Bounds, NoPlanIsBeyondThem) {
  const std::string toml = with_motors(kRobot, "max_step_rate = 6000", true);
  for (const double duration_s : {4.0, 6.0, 10.0}) {
    const Planned p =
        plan_of(toml + "avoid_resonance = false\ngoal = [0.4, 0.0]\nduration = " + std::to_string(duration_s) + "\n");
    const auto motors = reach_of_motors(p.problem, duration_s, true);
    ASSERT_TRUE(motors);
    EXPECT_GT(motors->distance_m, 0.4);
    EXPECT_GT(reach_of_motors(p.problem, 1.1 * duration_s, true)->distance_m, motors->distance_m);
    EXPECT_GT(reach_of_motors(p.problem, duration_s, false)->distance_m, motors->distance_m);
    const double least_s = least_duration_of_motors_s(p.problem, 100, true);
    EXPECT_LT(reach_of_motors(p.problem, 0.99 * least_s, true)->distance_m, 100);
    EXPECT_GT(reach_of_motors(p.problem, 1.03 * least_s, true)->distance_m, 100);
  }
}

// A ball that starts off balance rolls by itself: that its masses cannot move proves nothing.
TEST(Bounds, ABallOffBalanceMayRollWithoutItsMasses) {
  const std::string toml = with_motors(kRobot, "max_acceleration = 1e-9", true) + "goal = [0.2, 0]\nduration = 3\n";
  std::vector<sim::ScenarioError> errors;
  const auto task = parse_task(toml, "task.toml", errors);
  ASSERT_TRUE(task) << errors_of(toml);
  Problem problem = make_problem(*task);
  EXPECT_NE(immobile(problem), "");
  problem.start.q = {std::cos(0.3), 0, std::sin(0.3), 0};
  EXPECT_EQ(immobile(problem), "");
  problem.start.q = {0, 0, 1, 0};  // on its head
  EXPECT_EQ(immobile(problem), "");
}

// Limits of motors hold where the masses are prescribed, too, if the file has the motors.
TEST(Plan, KeepsTheLimitsOfMotorsOfPrescribedMasses) {
  const Planned free = plan_of(kRobot + "goal = [0.4, 0]\nduration = 6\n");
  const Planned p = plan_of(with_motors(kRobot, "max_step_rate = 1500, max_acceleration = 2, max_jerk = 20", false) +
                            "goal = [0.4, 0]\nduration = 6\n");
  ASSERT_TRUE(free.outcome.plan && p.outcome.plan);
  const auto greatest = [](const Planned& of) {
    std::array<double, 3> out{};  // speed, acceleration, jerk
    const Plan& plan = *of.outcome.plan;
    for (const Node& node : of.nodes) {
      for (const double v : node.state.velocity) out[0] = std::max(out[0], std::abs(v));
    }
    for (std::size_t v = 0; v + 3 < plan.knots.size(); ++v) {
      out[1] = std::max(out[1], std::abs(plan.knots[v]));
      out[2] = std::max(out[2], std::abs(plan.knots[v + 3] - plan.knots[v]) / plan.grid.piece_s());
    }
    return out;
  };
  const double most_speed = 1500 / (200 * 16 * 4 / (2 * std::numbers::pi));
  const auto without = greatest(free), with = greatest(p);
  EXPECT_GT(without[0], most_speed);  // else this test says nothing
  EXPECT_LE(with[0], most_speed * (1 + 1e-3));
  EXPECT_LE(with[1], 2);
  EXPECT_LE(with[2], 20);
  EXPECT_NE(p.outcome.binding.find("motor.max_step_rate"), std::string::npos) << p.outcome.binding;
}

// Each wrong value gives one error, which names the key.
TEST(PlanTask, EveryKeyWrongOnceIsOneClearError) {
  const std::string good = "goal = [0.5, 0]\nduration = 6\n";
  const std::pair<const char*, const char*> wrong[] = {
      {"duration = 6\n", "task.goal"},
      {"goal = [0.5]\nduration = 6\n", "task.goal"},
      {"goal = [0.5, nan]\nduration = 6\n", "task.goal.1"},
      {"goal = [0.5, 0]\n", "task.duration"},
      {"goal = [0.5, 0]\nduration = -1\n", "task.duration"},
      {"at_rest = 1\n", "task.at_rest"},
      {"objective = \"speed\"\n", "task.objective"},
      {"friction_use = 1.5\n", "task.friction_use"},
      {"friction_use = 0\n", "task.friction_use"},
      {"via = 3\n", "task.via"},
      {"via = [ { time = 1 } ]\n", "task.via.0.position"},
      {"via = [ { position = [0, 0, 0] } ]\n", "task.via.0.position"},
      {"via = [ { position = [0.1, 0], time = 7 } ]\n", "task.via.0.time"},
      {"via = [ { position = [0.1, 0], time = 3 }, { position = [0.2, 0], time = 2 } ]\n", "task.via.1.time"},
      {"keep_out = [ { center = [0.3, 0] } ]\n", "task.keep_out.0.radius"},
      {"keep_out = [ { center = [0.5, 0.1], radius = 0.1 } ]\n", "task.goal"},
      {"keep_out = [ { center = [0, 0.1], radius = 0.1 } ]\n", "task.keep_out"},
      {"mass_position = [0.0]\n", "task.mass_position"},
      {"follow = { points = [[0, 0]], tolerance = 0.1 }\n", "task.follow.points"},
      {"follow = { points = [[0, 0], [1, 0]] }\n", "task.follow.tolerance"},
      {"follow = { points = [[0, 0], [0.2, 0]], tolerance = 0.1 }\n", "task.goal"},
      {"avoid_resonance = \"yes\"\n", "task.avoid_resonance"},
      {"torque_margin = 1.0\n", "task.torque_margin"},
      {"friction_usage = 0.5\n", "task.friction_usage"},
  };
  EXPECT_EQ(errors_of(kRobot + good), "");
  for (const auto& [text, key] : wrong) {
    const bool whole = std::string(text).find("goal") == 0 || std::string(text).find("duration") == 0;
    const std::string errors = errors_of(kRobot + (whole ? "" : good) + text);
    EXPECT_EQ(std::count(errors.begin(), errors.end(), '\n'), 1) << text << errors;
    EXPECT_NE(errors.find(std::string(": ") + key), std::string::npos) << text << errors;
    EXPECT_NE(errors.find("allowed"), std::string::npos) << text << errors;
    EXPECT_EQ(errors.find("task.toml:"), 0u) << text << errors;
  }
}

TEST(PlanTask, WrongFloorsAreOneClearError) {
  const std::pair<const char*, const char*> floors[] = {
      {"slope = { angle = 1.6, downhill = 0.7 }\n", "surface.slope.angle"},
      {"slope = 0.05\n", "surface.slope"},
      {"rolling_resistance = nan\n", "surface.rolling_resistance"},
      {"spin_friction = -0.001\n", "surface.spin_friction"},
  };
  for (const auto& [text, key] : floors) {
    const std::string errors = errors_of(on_floor(text, "goal = [0.5, 0]\nduration = 6\n"));
    EXPECT_EQ(std::count(errors.begin(), errors.end(), '\n'), 1) << text << errors;
    EXPECT_NE(errors.find(std::string(": ") + key), std::string::npos) << text << errors;
    EXPECT_NE(errors.find("allowed"), std::string::npos) << text << errors;
  }
}

TEST(PlanTask, RefusesAScenarioThatIsNoTask) {
  EXPECT_NE(errors_of(kRobot.substr(0, kRobot.find("[task]")) + "").find("task: is missing"), std::string::npos);
  std::string moving = kRobot;
  moving.insert(moving.find("rail ="), "motion = [ { duration = 1, acceleration = [0, 0] } ]\n");
  EXPECT_NE(errors_of(moving + "goal = [0.5, 0]\nduration = 6\n").find("mass.0.motion"), std::string::npos);
}

}  // namespace
}  // namespace ballast::plan
