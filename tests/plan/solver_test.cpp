// The parts of the solver: derivatives of a rollout, and the quadratic program.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tools/plan/quadratic_program.h"
#include "tools/plan/rollout.h"

namespace ballast::plan {
namespace {

TEST(Rollout, SensitivitiesAreThoseByDifferences) {
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
  const Grid grid{6, 4, 8};
  Rollout rollout(problem, grid);
  std::vector<double> knots{0.1, -0.2, 0.3, 0.1, -0.2, 0.2, 0.1, 0.0, -0.1, 0.1};
  ASSERT_TRUE(rollout.roll(knots));
  rollout.differentiate();
  const int last = grid.nodes() - 1;
  for (std::size_t v = 0; v < knots.size(); ++v) {
    constexpr double kStep = 1e-5;
    std::array<double, 2> place[2];
    for (int side = 0; side < 2; ++side) {
      auto moved = knots;
      moved[v] += side == 0 ? -kStep : kStep;
      Rollout other(problem, grid);
      ASSERT_TRUE(other.roll(moved));
      place[side] = other.nodes().back().place_m;
    }
    for (int c = 0; c < 2; ++c) {
      const double difference =
          (place[1][static_cast<std::size_t>(c)] - place[0][static_cast<std::size_t>(c)]) / (2 * kStep);
      // The variational equations are integrated by the same RK4: they differ from the map's derivative by its error.
      EXPECT_NEAR(rollout.sensitivity(last, 6 + c)[v], difference, 1e-4 * std::max(1.0, std::abs(difference)));
    }
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
