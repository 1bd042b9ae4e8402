// The plant against Simbody (simbody_ball.h), which knows bodies, joints and one rolling constraint, and nothing of
// this project's equations: N(t), the friction and the state along the paper's runs, the extrema, the detachment, and a
// robot with what the paper's do not have.
//
// Tolerances. At accuracy 1e-12 the two are 2e-11 to 7e-11 apart in the state at worst, and up to 1e-10 in the forces,
// which are 5 and more; ConvergesToThePlant shows that this is mostly Simbody's own error, for it goes with Simbody's
// accuracy. The bars are some ten to fifty times that: how Simbody chooses its steps is its own business.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <memory>

#include "sim/plant/plant.h"
#include "tests/simbody/robot_of.h"

namespace ballast {
namespace {

constexpr double kAccuracy = 1e-12;

sim::Scenario shipped(const std::string& name) {
  const auto result =
      sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", {"run.actuation=\"prescribed\""});
  for (const auto& error : result.errors) ADD_FAILURE() << to_string(error);
  return result.scenario;
}

// Largest difference of the states; q and -q are the same attitude.
double state_distance(const sim::Plant::Sample& a, const peer::SimbodyBall::Sample& b, std::size_t masses) {
  double distance = std::max({std::min((a.orientation - b.orientation).norm(), (a.orientation + b.orientation).norm()),
                              (a.angular_velocity_B_radps - b.angular_velocity_B_radps).norm(),
                              (a.position_W_m - b.position_W_m).norm()});
  for (std::size_t i = 0; i < masses; ++i)
    distance = std::max({distance, std::abs(a.mass_position[i] - b.mass_position[i]),
                         std::abs(a.mass_velocity[i] - b.mass_velocity[i])});
  return distance;
}

double force_distance(const sim::Plant::Sample& a, const peer::SimbodyBall::Sample& b) {
  return std::max(std::abs(a.normal_force_n - b.normal_force_n), (a.friction_force_W_n - b.friction_force_W_n).norm());
}

double ratio(const peer::SimbodyBall::Sample& s) { return s.friction_force_W_n.norm() / s.normal_force_n; }

struct Distances {
  double state = 0, force = 0;
};

// The largest along the way, looked at ten times per time unit.
Distances compare(const sim::Scenario& scenario, double accuracy, double end_s) {
  sim::Plant plant(scenario);
  peer::SimbodyBall ball(peer::robot_of(scenario), accuracy);
  Distances worst;
  for (int k = 0; k <= std::lround(10 * end_s); ++k) {
    plant.advance(k / 10., {});
    ball.advance(k / 10.);
    EXPECT_EQ(plant.time_s(), ball.time_s()) << "the plant has stopped: " << static_cast<int>(plant.end());
    const auto p = plant.sample();
    const auto b = ball.sample();
    worst.state = std::max(worst.state, state_distance(p, b, scenario.masses.size()));
    worst.force = std::max(worst.force, force_distance(p, b));
  }
  return worst;
}

// The greatest `value` of a Simbody run: ten samples per time unit; then every peak among them that comes within a
// hundredth of the greatest by golden section between its neighbours, integrating again from the one before.
sim::Extremum greatest(const sim::Scenario& scenario, double end_s,
                       const std::function<double(const peer::SimbodyBall::Sample&)>& value) {
  constexpr double kGrid_s = 0.1;
  struct GridPoint {
    double time_s, value;
    std::shared_ptr<const peer::SimbodyBall::Snapshot> state;
  };
  std::vector<GridPoint> grid;
  peer::SimbodyBall ball(peer::robot_of(scenario), kAccuracy);
  sim::Extremum best{-std::numeric_limits<double>::infinity(), 0};
  for (int k = 0; k <= std::lround(end_s / kGrid_s); ++k) {
    ball.advance(k * kGrid_s);
    grid.push_back({ball.time_s(), value(ball.sample()), ball.snapshot()});
    if (grid.back().value > best.value) best = {grid.back().value, grid.back().time_s};
  }
  const double worth_a_look = best.value - 0.01 * std::abs(best.value);
  for (std::size_t k = 1; k + 1 < grid.size(); ++k) {
    const GridPoint &before = grid[k - 1], &peak = grid[k], &after = grid[k + 1];
    if (peak.value < worth_a_look || peak.value < before.value || peak.value < after.value) continue;
    const auto at = [&](double t) {
      ball.restore(*before.state);
      ball.advance(t);
      const double v = value(ball.sample());
      if (v > best.value) best = {v, t};
      return v;
    };
    const double golden = (std::sqrt(5.) - 1) / 2;
    double a = before.time_s, b = after.time_s;
    double c = b - golden * (b - a), d = a + golden * (b - a), fc = at(c), fd = at(d);
    while (b - a > 1e-6) {
      if (fc > fd) {
        b = d, d = c, fd = fc;
        c = b - golden * (b - a), fc = at(c);
      } else {
        a = c, c = d, fc = fd;
        d = a + golden * (b - a), fd = at(d);
      }
    }
  }
  return best;
}

class PaperRun : public testing::TestWithParam<const char*> {};

TEST_P(PaperRun, FollowsSimbodyFromEndToEnd) {
  const auto worst = compare(shipped(GetParam()), kAccuracy, 20);
  EXPECT_LT(worst.state, 1e-9);
  EXPECT_LT(worst.force, 1e-9);
}

// A peak is flat: its value is as good as the forces, or better; its time to about the square root of that, and no
// better than the 1e-6 at which the search stops.
TEST_P(PaperRun, ExtremaAreSimbodys) {
  const auto scenario = shipped(GetParam());
  sim::Plant plant(scenario);
  plant.advance(20, {});
  const auto normal = [](const auto& s) { return s.normal_force_n; };
  const auto mu = greatest(scenario, 20, ratio);
  EXPECT_NEAR(plant.extrema().mu_required_max.value, mu.value, 1e-10);
  EXPECT_NEAR(plant.extrema().mu_required_max.time_s, mu.time_s, 1e-5);
  const auto least = greatest(scenario, 20, [&](const auto& s) { return -normal(s); });
  EXPECT_NEAR(plant.extrema().normal_force_min.value, -least.value, 1e-10);
  EXPECT_NEAR(plant.extrema().normal_force_min.time_s, least.time_s, 1e-5);
  const auto most = greatest(scenario, 20, normal);
  EXPECT_NEAR(plant.extrema().normal_force_max.value, most.value, 1e-10);
  EXPECT_NEAR(plant.extrema().normal_force_max.time_s, most.time_s, 1e-5);
}

INSTANTIATE_TEST_SUITE_P(Simbody, PaperRun, testing::Values("paper_ball", "paper_disk"),
                         [](const auto& instance) { return std::string(instance.param); });

// The difference between the two falls with Simbody's accuracy; a difference of the models would stay. Simbody keeps
// the error of a step in proportion to its accuracy, so a hundredth of the one is about a hundredth of the other. Bar:
// a fifth of that fall, because steps are not all chosen alike.
TEST(Simbody, ConvergesToThePlant) {
  const auto scenario = shipped("paper_ball");
  sim::Plant plant(scenario);
  plant.advance(20, {});
  const auto distance = [&](double accuracy) {
    peer::SimbodyBall ball(peer::robot_of(scenario), accuracy);
    ball.advance(20);
    return state_distance(plant.sample(), ball.sample(), scenario.masses.size());
  };
  const double coarse = distance(1e-6), middle = distance(1e-8), fine = distance(1e-10);
  EXPECT_LT(middle, coarse / 20);
  EXPECT_LT(fine, middle / 20);
}

// N falls at about 40 per time unit, so that forces good to 3e-10 (those of the heavy mass are ten times paper_ball's)
// give the instant to 1e-11.
TEST(Simbody, HeavyMassDetachesAtTheSameInstant) {
  const auto scenario = shipped("paper_detach");
  sim::Plant plant(scenario);
  plant.advance(20, {});
  ASSERT_EQ(plant.end(), sim::PhysicsEnd::kDetached);

  peer::SimbodyBall ball(peer::robot_of(scenario), kAccuracy);
  auto before = ball.snapshot();
  double on_s = 0;
  while (ball.sample().normal_force_n > 0) {
    ASSERT_LT(ball.time_s(), 20);
    before = ball.snapshot(), on_s = ball.time_s();
    ball.advance(on_s + 0.1);
  }
  double off_s = ball.time_s();
  for (int halving = 0; halving < 45; ++halving) {  // 0.1 down to rounding
    const double middle_s = (on_s + off_s) / 2;
    ball.restore(*before);
    ball.advance(middle_s);
    (ball.sample().normal_force_n > 0 ? on_s : off_s) = middle_s;
  }
  EXPECT_NEAR(plant.time_s(), off_s, 1e-10);
  ball.restore(*before);
  ball.advance(plant.time_s());
  EXPECT_LT(state_distance(plant.sample(), ball.sample(), scenario.masses.size()), 1e-9);
  EXPECT_LT(force_distance(plant.sample(), ball.sample()), 1e-8);  // measured: 3e-10
}

// Lines, circles off the centre, accelerations that jump, a start in the middle of a turn: what paper_ball lacks.
sim::Scenario robot_with_lines_and_jumps() {
  const auto result = sim::parse_scenario(R"(
name = "lines"
duration = 6
gravity = 9.81
[ball]
radius = 0.2
mass = 1.3
inertia = [0.02, 0.025, 0.03]
center_of_mass = [0.01, -0.02, -0.03]
[[mass]]
mass = 0.7
rail = { shape = "line", origin = [0.01, 0.02, -0.1], direction = [1, 0.5, 0.2] }
initial_position = -0.03
initial_velocity = 0.05
motion = [ { duration = 0.5, acceleration = [0.2, -0.1] }, { duration = 0.7, acceleration = [-0.3, 0.1] } ]
[[mass]]
mass = 0.4
rail = { shape = "circle", radius = 0.07, center = [0.02, -0.05, 0.01], axes = [[0, 0.6, 0.8], [1, 0, 0]] }
initial_position = 1.0
initial_velocity = -2.0
motion = [ { duration = 0.8, acceleration = [3.0, 2.0] }, { duration = 0.33, acceleration = [-4.0, -4.0] } ]
[initial]
orientation = [0.5, 0.5, -0.5, 0.5]
angular_velocity = [0.8, -0.5, 1.1]
position = [0.3, -0.2]
[run]
actuation = "prescribed"
)",
                                          "lines", {});
  for (const auto& error : result.errors) ADD_FAILURE() << to_string(error);
  return result.scenario;
}

TEST(Simbody, FollowsARobotWithLinesAndJumps) {
  const auto worst = compare(robot_with_lines_and_jumps(), kAccuracy, 6);
  EXPECT_LT(worst.state, 1e-9);
  EXPECT_LT(worst.force, 1e-9);
}

TEST(Simbody, FollowsARobotThatIsPushedConstantly) {
  auto scenario = robot_with_lines_and_jumps();
  scenario.external_force_W_n = {0.9, -0.6, 1.5};
  const auto worst = compare(scenario, kAccuracy, 6);
  EXPECT_LT(worst.state, 1e-9);
  EXPECT_LT(worst.force, 1e-9);
}

// A table whose times are neither motion borders nor, two of them, times at which compare() asks for the state: both
// programs have to stop at the kinks of the force by themselves. And drag in a wind that is not level.
TEST(Simbody, FollowsARobotInGustsAndWind) {
  auto scenario = robot_with_lines_and_jumps();
  scenario.force_table.times_s = {0.25, 1.0, 1.75, 4.5};
  scenario.force_table.forces_W_n = {{0.5, 0, 0}, {-1.0, 0.8, 2.0}, {0.3, 0.3, -1.0}, {0, -0.2, 0}};
  scenario.drag.coefficient_kgpm = 0.4;
  scenario.drag.wind_W_mps = {0.7, -0.3, 0.2};
  const auto worst = compare(scenario, kAccuracy, 6);
  EXPECT_LT(worst.state, 1e-9);
  EXPECT_LT(worst.force, 1e-9);
}

}  // namespace
}  // namespace ballast
