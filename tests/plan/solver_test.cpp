// The parts of the solver: derivatives of a rollout, and the quadratic program.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>

#include "tools/plan/plant_check.h"
#include "tools/plan/quadratic_program.h"
#include "tools/plan/read_task.h"
#include "tools/plan/rollout.h"

namespace ballast::plan {
namespace {

Problem two_masses() {
  Problem problem;
  firmware::BallParams& ball = problem.robot.ball;
  ball.radius_m = 1;
  ball.gravity_mps2 = 1;
  ball.shell_mass_kg = 1;
  ball.inertia_kgm2 = firmware::Vector3(0.9, 1, 1.1);
  ball.center_of_mass_B_m = firmware::Vector3(0, 0, -0.1);
  ball.mass_count = 2;
  for (std::size_t i = 0; i < 2; ++i) {
    ball.mass_kg[i] = 0.5;
    ball.rail[i] = firmware::circle_about(0.8, static_cast<double>(i), 0.3);
    problem.metres_per_unit[i] = 0.8;
  }
  return problem;
}

// The greatest difference of the last place's sensitivities from central differences, relative to 1.
double sensitivity_error(const Problem& problem) {
  const Grid grid{6, 4, 8};
  Rollout rollout(problem, grid);
  std::vector<double> knots{0.1, -0.2, 0.3, 0.1, -0.2, 0.2, 0.1, 0.0, -0.1, 0.1};
  EXPECT_TRUE(rollout.roll(knots));
  rollout.differentiate();
  const int last = grid.nodes() - 1;
  double worst = 0;
  for (std::size_t v = 0; v < knots.size(); ++v) {
    constexpr double kStep = 1e-5;
    std::array<double, 2> place[2];
    for (int side = 0; side < 2; ++side) {
      auto moved = knots;
      moved[v] += side == 0 ? -kStep : kStep;
      Rollout other(problem, grid);
      EXPECT_TRUE(other.roll(moved));
      place[side] = other.nodes().back().place_m;
    }
    for (int c = 0; c < 2; ++c) {
      const double difference =
          (place[1][static_cast<std::size_t>(c)] - place[0][static_cast<std::size_t>(c)]) / (2 * kStep);
      const double error = std::abs(rollout.sensitivity(last, 6 + c)[v] - difference);
      worst = std::max(worst, error / std::max(1.0, std::abs(difference)));
    }
  }
  return worst;
}

// The variational equations are integrated by the same RK4: they differ from the map's derivative by its error.
TEST(Rollout, SensitivitiesAreThoseByDifferences) { EXPECT_LT(sensitivity_error(two_masses()), 1e-4); }

// The ball starts at rest, where the moment turns round within the creep rate and steps are made in parts.
TEST(Rollout, SensitivitiesHoldWhereAFloorBrakesTheBall) {
  Problem problem = two_masses();
  firmware::BallParams& ball = problem.robot.ball;
  ball.down_W = firmware::Vector3(std::sin(0.05), 0, -std::cos(0.05));
  ball.rolling_resistance = 0.02;
  ball.spin_friction_m = 0.002;
  ball.creep_radps = 1e-3;
  EXPECT_LT(sensitivity_error(problem), 1e-3);
}

// A ball that starts at rest, stops and rocks on floors that resist: as the plant, whose steps are adaptive, has it.
TEST(Rollout, FollowsThePlantThroughStandstills) {
  for (const double resistance : {0.005, 0.02, 0.1, 0.3}) {
    SCOPED_TRACE(resistance);
    const std::string toml =
        "name = \"slow\"\ngravity = 1.0\n[ball]\nradius = 1.0\nmass = 1.0\ninertia = [0.6, 0.6, 0.6]\n[[mass]]\nmass = "
        "0.8\nrail = { shape = \"circle\", radius = 0.6, axes = [[0, 0, -1], [1, 0, 0]] }\n[surface]\n"
        "slope = { angle = 0.02, downhill = 1.0 }\nspin_friction = 0.01\nrolling_resistance = " +
        std::to_string(resistance) + "\n[task]\ngoal = [0, 0]\nduration = 30\n";
    std::vector<sim::ScenarioError> errors;
    const auto task = parse_task(toml, "task", errors);
    ASSERT_TRUE(task) << sim::to_string(errors.front());
    const Problem problem = make_problem(*task);
    const Grid grid = make_grid(problem, 30, 32);
    std::vector<double> knots(static_cast<std::size_t>(grid.knots()));
    for (std::size_t j = 0; j < knots.size(); ++j) knots[j] = 0.15 * std::sin(0.2 * static_cast<double>(j * j));
    Rollout rollout(problem, grid);
    ASSERT_TRUE(rollout.roll(knots));
    const PlantRun run = roll_by_plant(problem, task->scenario, grid, knots);
    ASSERT_EQ(run.nodes.size(), rollout.nodes().size());
    double worst = 0, way = 0;
    for (std::size_t k = 0; k < run.nodes.size(); ++k) {
      for (std::size_t c = 0; c < 2; ++c) {
        worst = std::max(worst, std::abs(run.nodes[k].place_m[c] - rollout.nodes()[k].place_m[c]));
        way += k == 0 ? 0 : std::abs(run.nodes[k].place_m[c] - run.nodes[k - 1].place_m[c]);
      }
    }
    std::printf("c_rr = %g: %.2g r apart over a way of %.2g r\n", resistance, worst, way);
    EXPECT_LT(worst, 1e-5);  // of RK4 over a plan (make_grid())
  }
}

TEST(QuadraticProgram, FindsTheLeastGreatestRow) {
  // minimise t with |x - 1| <= t, |x + 3| <= t: x = -1, t = 2.
  QuadraticProgram program;
  program.size = 1;
  program.hessian = {1e-8};
  program.gradient = {0};
  program.coefficients = {1, 1};
  program.rows = {{0, 0, 1, -1, 0, 0, true, true}, {1, 0, 1, 3, 0, 0, true, true}};
  program.level_weight = 1;
  program.penalty = 30;
  const ProgramSolution solution = solve(program);
  EXPECT_NEAR(solution.x[0], -1, 1e-3);
  EXPECT_NEAR(solution.level, 2, 1e-3);
  EXPECT_NEAR(solution.decrease, 1, 1e-3);
}

TEST(QuadraticProgram, LimitsHoldWhereTheyCanAndYieldWhereTheyCannot) {
  // minimise (x - 5)^2 / 2 with x <= 2: x = 2 at the price 3.
  QuadraticProgram program;
  program.size = 1;
  program.hessian = {1};
  program.gradient = {-5};
  program.coefficients = {1};
  const double infinity = std::numeric_limits<double>::infinity();
  program.rows = {{0, 0, 1, 0, -infinity, 2, false, true}};
  program.penalty = 30;
  EXPECT_NEAR(solve(program).x[0], 2, 1e-3);
  EXPECT_NEAR(solve(program).pressure[0], 3, 1e-2);
  program.penalty = 1;  // cheaper than what it costs to hold it
  EXPECT_NEAR(solve(program).x[0], 4, 1e-3);
}

TEST(QuadraticProgram, RandomProgramsKeepTheirConditions) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> u(-1, 1);
    constexpr int n = 10, m = 40;
    QuadraticProgram program;
    program.size = n;
    program.hessian.assign(std::size_t{n} * n, 0);
    for (int i = 0; i < n; ++i) program.hessian[static_cast<std::size_t>(i * n + i)] = 0.5 + u(random) * 0.3;
    for (int i = 0; i < n; ++i) program.gradient.push_back(u(random));
    for (int r = 0; r < m; ++r) {
      program.rows.push_back({program.coefficients.size(), 0, n, u(random), -0.5, 0.5, false, true});
      for (int i = 0; i < n; ++i) program.coefficients.push_back(u(random));
    }
    program.penalty = 2;
    const ProgramSolution solution = solve(program);
    // Stationarity: H x + g + sum pressure J = 0; pressures within the penalty.
    for (int i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      double sum = program.hessian[static_cast<std::size_t>(i * n + i)] * solution.x[k] + program.gradient[k];
      for (std::size_t r = 0; r < program.rows.size(); ++r) {
        sum += solution.pressure[r] * program.coefficients[program.rows[r].offset + k];
      }
      EXPECT_NEAR(sum, 0, 1e-4);
    }
    for (const double pressure : solution.pressure) EXPECT_LE(std::abs(pressure), 2.0);
    EXPECT_GT(solution.decrease, 0);
  }
}

}  // namespace
}  // namespace ballast::plan
