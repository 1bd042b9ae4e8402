// Scenarios nobody designed: the plant against CVODE on the paper's closed forms.
#include <gtest/gtest.h>

#include "sim/plant/plant.h"
#include "tests/physics/closed_form_run.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

double friction_use(const firmware::RollingForces& f) { return f.static_friction_n / f.normal_force_n; }

// 1e-8 is the bar for the shipped scenarios; these must be as good.
TEST(RandomScenario, PlantAgreesWithCvodeOnTheClosedForms) {
  const std::uint64_t seed = ballast::test::random_seed(7);
  int completed = 0, detached = 0;
  for (int trial = 0; trial < 60; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    const Scenario scenario = random.scenario(trial % (kMaxMasses + 1));
    Plant plant(scenario);
    test::ClosedFormRun reference(scenario);
    for (std::int64_t k = 1; plant.time_s() < scenario.duration_s && plant.end() == PhysicsEnd::kNone; ++k) {
      plant.advance(std::min(static_cast<double>(k) * scenario.run.control_period_s, scenario.duration_s), {});
    }
    (plant.end() == PhysicsEnd::kNone ? completed : detached) += 1;
    ASSERT_NE(plant.end(), PhysicsEnd::kInconsistent);
    ASSERT_TRUE(reference.advance(plant.time_s()));
    const auto s = plant.sample();
    const double rate = std::sqrt(scenario.gravity_mps2 / scenario.ball.radius_m);
    EXPECT_LT(
        std::min((s.orientation - reference.orientation()).norm(), (s.orientation + reference.orientation()).norm()),
        1e-8);
    EXPECT_LT((s.angular_velocity_B_radps - reference.angular_velocity_B()).norm(), 1e-8 * rate);
    EXPECT_LT((s.position_W_m.head<2>() - reference.position_W()).norm(), 1e-8);
    EXPECT_NEAR(s.orientation.norm(), 1, 4e-16);  // the quaternion is kept unit: rounding of one division
    const auto forces = reference.forces();
    const double weight =
        forces.static_friction_n + std::abs(forces.normal_force_n) + scenario.ball.mass_kg * scenario.gravity_mps2;
    EXPECT_NEAR(s.normal_force_n, forces.normal_force_n, 1e-7 * weight);
    EXPECT_NEAR(s.static_friction_n, forces.static_friction_n, 1e-7 * weight);
  }
  EXPECT_GT(completed, 20);  // the robots are meant to roll, mostly
  RecordProperty("completed", completed);
  RecordProperty("detached", detached);
}

// The extrema against a dense scan of the independent run: nothing in the scan may beat them, and something must come
// close.
TEST(RandomScenario, ExtremaAreThoseOfADenseScan) {
  const std::uint64_t seed = ballast::test::random_seed(11);
  for (int trial = 0; trial < 12; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario scenario = random.scenario(1 + trial % 4);
    scenario.run.control_period_s = 0.05;
    Plant plant(scenario);
    for (int k = 1; plant.time_s() < scenario.duration_s && plant.end() == PhysicsEnd::kNone; ++k) {
      plant.advance(std::min(k * 0.05, scenario.duration_s), {});
    }
    if (plant.end() != PhysicsEnd::kNone) continue;
    test::ClosedFormRun reference(scenario);
    double mu = friction_use(reference.forces()), low = reference.forces().normal_force_n, high = low;
    constexpr int kScan = 4000;
    for (int j = 1; j <= kScan; ++j) {
      ASSERT_TRUE(reference.advance(scenario.duration_s * j / kScan));
      const auto f = reference.forces();
      mu = std::max(mu, friction_use(f));
      low = std::min(low, f.normal_force_n);
      high = std::max(high, f.normal_force_n);
    }
    const auto& x = plant.extrema();
    const double weight = high;
    EXPECT_LE(mu, x.mu_required_max.value * (1 + 1e-7));
    EXPECT_GE(low, x.normal_force_min.value - 1e-7 * weight);
    EXPECT_LE(high, x.normal_force_max.value + 1e-7 * weight);
    // A scan point is at most 1/8000 of the run away from a peak (curvature: 1e-4 relative), or just beside a jump,
    // whose left side the scan never sees.
    EXPECT_NEAR(high, x.normal_force_max.value, 0.05 * weight);
    EXPECT_NEAR(low, x.normal_force_min.value, 0.05 * weight);
  }
}

}  // namespace
}  // namespace ballast::sim
