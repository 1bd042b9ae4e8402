#include "sim/plant/rolling_ode.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/physics/random_robot.h"

namespace ballast::sim {
namespace {

using State = RollingOde::State;
constexpr std::size_t kSize = RollingOde::kSize;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Case {
  explicit Case(std::uint64_t seed) : robot(seed), scenario(robot.scenario(robot.integer(0, 4))) {
    scenario.external_force_W_n = robot.vector(1);
    scenario.drag.coefficient_kgpm = robot.uniform(0.1, 1);
    scenario.drag.wind_W_mps = robot.vector(1);
    const Eigen::Quaterniond q = robot.attitude();
    const double length = robot.uniform(0.8, 1.2);  // it need not be 1
    y = {length * q.w(), length * q.x(), length * q.y(), length * q.z()};
    for (std::size_t j = RollingOde::kOmega; j < kSize; ++j) y[j] = robot.uniform(-2, 2);
  }
  test::RandomRobot robot;
  Scenario scenario;
  State y{};
};

// Central differences of order 8 with h = 0.002: their error is h^8 / 630 = 4e-25 times the ninth derivative (some 1e8,
// where drag is near its rest), and their division magnifies the rounding of f, 1e-15 of some tens, to some 1e-11.
TEST(RollingOde, JacobianIsThatOfDifferences) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Case c(seed);
    const RollingOde ode(c.scenario);
    std::array<double, kSize * kSize> jacobian{};
    ode.jacobian(0.01, c.y.data(), jacobian.data());
    double largest = 0;
    for (const double entry : jacobian) largest = std::max(largest, std::abs(entry));
    for (std::size_t k = 0; k < kSize; ++k) {
      constexpr double kWeights[] = {4. / 5, -1. / 5, 4. / 105, -1. / 280};
      constexpr double kH = 0.002;
      State difference{};
      for (int m = 1; m <= 4; ++m) {
        State above = c.y, below = c.y, f_above{}, f_below{};
        above[k] += m * kH;
        below[k] -= m * kH;
        ode.derivative(0.01, above.data(), f_above.data());
        ode.derivative(0.01, below.data(), f_below.data());
        for (std::size_t i = 0; i < kSize; ++i) difference[i] += kWeights[m - 1] * (f_above[i] - f_below[i]) / kH;
      }
      for (std::size_t i = 0; i < kSize; ++i) {
        EXPECT_NEAR(jacobian[i + kSize * k], difference[i], 1e-10 * largest) << "d f_" << i << " / d y_" << k;
      }
    }
  }
}

// qdot = q Omega / 2 and zdot = (Lambda Omega x r e3): their derivatives can be written down. What complex step gives
// is off by the rounding of a few products.
TEST(RollingOde, JacobianIsExactWhereItIsKnown) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Case c(seed);
    const RollingOde ode(c.scenario);
    std::array<double, kSize * kSize> jacobian{};
    ode.jacobian(0.01, c.y.data(), jacobian.data());
    const auto at = [&](std::size_t i, std::size_t k) { return jacobian[i + kSize * k]; };
    const double* q = c.y.data();
    const double* o = c.y.data() + RollingOde::kOmega;
    const double by_q[4][4] = {
        {0, -o[0], -o[1], -o[2]}, {o[0], 0, o[2], -o[1]}, {o[1], -o[2], 0, o[0]}, {o[2], o[1], -o[0], 0}};
    const double by_omega[4][3] = {
        {-q[1], -q[2], -q[3]}, {q[0], -q[3], q[2]}, {q[3], q[0], -q[1]}, {-q[2], q[1], q[0]}};
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t k = 0; k < 4; ++k) EXPECT_DOUBLE_EQ(at(i, k), by_q[i][k] / 2);
      for (std::size_t k = 0; k < 3; ++k) EXPECT_DOUBLE_EQ(at(i, RollingOde::kOmega + k), by_omega[i][k] / 2);
    }
    const Eigen::Matrix3d lambda = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
    const double r = c.scenario.ball.radius_m;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto column = static_cast<Eigen::Index>(k);
      EXPECT_NEAR(at(RollingOde::kZ, RollingOde::kOmega + k), r * lambda(1, column), 2e-15);
      EXPECT_NEAR(at(RollingOde::kZ + 1, RollingOde::kOmega + k), -r * lambda(0, column), 2e-15);
    }
    for (std::size_t i = 0; i < kSize; ++i) {
      for (std::size_t k = RollingOde::kZ; k < kSize; ++k) EXPECT_EQ(at(i, k), 0);
    }
  }
}

// The attitude is that of q / |q|, and |q| stays: q . qdot = 0.
TEST(RollingOde, TheLengthOfTheQuaternionMattersToNothing) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Case c(seed);
    const RollingOde ode(c.scenario);
    State f{}, g{}, unit = c.y;
    const double length = Eigen::Vector4d(c.y[0], c.y[1], c.y[2], c.y[3]).norm();
    for (std::size_t j = 0; j < 4; ++j) unit[j] /= length;
    ode.derivative(0.01, c.y.data(), f.data());
    ode.derivative(0.01, unit.data(), g.data());
    double drift = 0;
    for (std::size_t j = 0; j < 4; ++j) {
      drift += c.y[j] * f[j];
      EXPECT_NEAR(f[j], length * g[j], 1e-15 * (1 + std::abs(f[j])));
    }
    EXPECT_NEAR(drift, 0, 4e-15);
    // Rounding of q / |q|, through a solution of a 3 x 3 system: some hundred times 1e-16.
    for (std::size_t j = 4; j < kSize; ++j) EXPECT_NEAR(f[j], g[j], 1e-13 * (1 + std::abs(g[j])));
  }
}

TEST(RollingOde, StretchesEndWhereMotionOrForceHasAKink) {
  Scenario scenario = test::RandomRobot(1).scenario(0);
  scenario.masses.resize(2);
  for (Mass& mass : scenario.masses) {
    mass.mass_kg = 0.1;
    mass.rail = firmware::line(Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX());
  }
  scenario.masses[0].motion = {{0.5, 1, 1}, {0.5, -1, -1}};
  scenario.masses[1].motion = {{0.75, 2, 0}};
  scenario.force_table.times_s = {0.25, 2};
  scenario.force_table.forces_W_n = {Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX()};
  RollingOde ode(scenario);
  std::vector<double> ends;
  for (double t = 0; t < kInfinity; t = ends.back()) {
    ode.begin(t);
    ends.push_back(ode.end_s());
    // At its end the stretch still is its own.
    const double inside = ode.masses((t + std::min(ends.back(), 3.0)) / 2).acceleration[0];
    EXPECT_EQ(ode.masses(std::min(ends.back(), 3.0)).acceleration[0], inside);
  }
  EXPECT_EQ(ends, (std::vector<double>{0.25, 0.5, 0.75, 1.0, 2.0, kInfinity}));
  ode.begin(0.5);  // the value after the jump counts
  EXPECT_EQ(ode.masses(0.5).acceleration[0], -1);
}

}  // namespace
}  // namespace ballast::sim
