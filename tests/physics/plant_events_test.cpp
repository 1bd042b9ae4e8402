// The first N = 0 and the first f_s = mu_s N, and what ends a run.
#include <gtest/gtest.h>

#include <cmath>

#include "sim/plant/plant.h"
#include "tests/physics/closed_form_run.h"
#include "tests/physics/random_robot.h"
#include "tests/random_seed.h"

namespace ballast::sim {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

void roll(Plant& plant, const Scenario& scenario, double period_s) {
  for (std::int64_t k = 1; plant.time_s() < scenario.duration_s && plant.end() == PhysicsEnd::kNone; ++k) {
    plant.advance(std::min(static_cast<double>(k) * period_s, scenario.duration_s), {});
  }
}

// A homogeneous ball that does not roll, with one mass on a vertical line through its centre: N = M g + m thetaddot.
Scenario lift(std::vector<MotionPiece> motion) {
  Scenario s;
  s.duration_s = 3;
  s.gravity_mps2 = 10;
  s.run.actuation = Actuation::kPrescribed;
  s.ball = {.radius_m = 1, .mass_kg = 2, .inertia_kgm2 = {0.8, 0.8, 0.8}, .center_of_mass_B_m = {0, 0, 0}};
  Mass m;
  m.mass_kg = 0.5;
  m.rail = firmware::line({0, 0, 0}, {0, 0, 1});
  m.motion = std::move(motion);
  m.motor.shaft_ratio = m.motor.holding_torque_nm = m.motor.rotor_inertia_kgm2 = m.motor.corner_speed_radps = 1;
  s.masses.push_back(m);
  return s;
}

// N = 25 - 0.5 * 100 t falls to 0 at t = 0.5, wherever the ticks are.
TEST(Detachment, IsFoundWhereTheClosedFormHasIt) {
  for (const double period_s : {0.001, 0.07, 0.5, 1.0}) {
    SCOPED_TRACE(period_s);
    const Scenario s = lift({{2.0, 0, -200}});
    Plant plant(s);
    roll(plant, s, period_s);
    EXPECT_EQ(plant.end(), PhysicsEnd::kDetached);
    EXPECT_NEAR(plant.time_s(), 0.5, 1e-9);
    EXPECT_LE(plant.sample().normal_force_n, 0);
    EXPECT_EQ(plant.extrema().mu_required_max.value, kInfinity);
    EXPECT_NEAR(plant.extrema().normal_force_max.value, 25, 1e-12);
  }
}

// A limit broken by a jump is broken at that instant.
TEST(Detachment, ByAJumpIsAtTheJump) {
  const Scenario s = lift({{0.3, 1, 1}, {0.2, -51, -51}});
  Plant plant(s);
  roll(plant, s, 0.07);
  EXPECT_EQ(plant.end(), PhysicsEnd::kDetached);
  EXPECT_EQ(plant.time_s(), 0.3);
  EXPECT_EQ(plant.sample().normal_force_n, 0);  // rolling on would need 25 - 0.5 * 51 < 0, and a floor cannot pull
  EXPECT_EQ(plant.extrema().normal_force_min.value, 0);
  EXPECT_NEAR(plant.extrema().normal_force_max.value, 25.5, 1e-12);
}

TEST(Detachment, AtTheStartEndsAtTheStart) {
  const Scenario s = lift({{0.3, -60, -60}});
  Plant plant(s);
  EXPECT_EQ(plant.end(), PhysicsEnd::kDetached);
  EXPECT_EQ(plant.time_s(), 0.0);
  plant.advance(1, {});
  EXPECT_EQ(plant.time_s(), 0.0);
}

// N = 25 - 0.5 a(t) with a rising to its peak and falling: a dip that just touches, or just does not, inside one tick.
TEST(Detachment, IsSeenInADipShorterThanATick) {
  const auto dip = [](double depth) { return lift({{0.4, 0, 0}, {0.01, 0, -depth}, {0.01, -depth, 0}}); };
  Scenario s = dip(50.001);
  Plant touching(s);
  roll(touching, s, 1.0);
  EXPECT_EQ(touching.end(), PhysicsEnd::kDetached);
  EXPECT_NEAR(touching.time_s(), 0.4 + 0.01 * 50 / 50.001, 1e-9);
  s = dip(49.999);
  Plant clear(s);
  roll(clear, s, 1.0);
  EXPECT_EQ(clear.end(), PhysicsEnd::kNone);
  EXPECT_NEAR(clear.extrema().normal_force_min.value, 25 - 0.5 * 49.999, 1e-9);
}

// Random robots on a floor that is a little too smooth: the instant at which they slip, against CVODE on the closed
// forms, whose f_s - mu_s N must change sign within 1e-9 s of it.
TEST(Slip, IsFoundToOneNanosecond) {
  const std::uint64_t seed = ballast::test::random_seed(13);
  int found = 0;
  for (int trial = 0; trial < 40 && found < 12; ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    test::RandomRobot random(seed * 1000 + static_cast<std::uint64_t>(trial));
    Scenario s = random.scenario(1 + trial % 4);
    Plant perfect(s);
    roll(perfect, s, 0.01);
    if (perfect.end() != PhysicsEnd::kNone) continue;
    s.surface.static_friction = 0.97 * perfect.extrema().mu_required_max.value;
    Plant plant(s);
    if (plant.end() != PhysicsEnd::kNone) continue;  // slips as it is set down
    roll(plant, s, 0.02);
    ASSERT_EQ(plant.end(), PhysicsEnd::kSlipped);
    const double t = plant.time_s();
    bool jump = false;  // at a jump there is no sign change to look for
    for (const auto& mass : s.masses) {
      double knot = 0;
      for (const auto& piece : mass.motion) jump |= std::abs((knot += piece.duration_s) - t) < 1e-8;
    }
    if (jump) continue;
    ++found;
    test::ClosedFormRun reference(s);
    const auto excess = [&] {
      const auto f = reference.forces();
      return f.static_friction_n - s.surface.static_friction * f.normal_force_n;
    };
    ASSERT_TRUE(reference.advance(t - 1e-9));
    EXPECT_LT(excess(), 0);
    ASSERT_TRUE(reference.advance(t + 1e-9));
    EXPECT_GT(excess(), 0);
    EXPECT_GT(plant.sample().static_friction_n, s.surface.static_friction * plant.sample().normal_force_n);
  }
  EXPECT_GE(found, 8);
}

// Floors just below and just above the friction a run needs, however its peak lies in the ticks: below, the ball slips,
// near the peak; above, it completes, and no friction is reported that the floor does not give.
class SlipAtAPeak : public testing::TestWithParam<const char*> {
 protected:
  Scenario scenario(double static_friction, double period_s) const {
    auto result =
        read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + GetParam() + ".toml", {"run.actuation=prescribed"});
    EXPECT_TRUE(result.ok());
    result.scenario.surface.static_friction = static_friction;
    result.scenario.run.control_period_s = period_s;
    return result.scenario;
  }
};

TEST_P(SlipAtAPeak, IsDecidedRightlyOnFloorsCloseToIt) {
  const Scenario perfect = scenario(kInfinity, 0.001);
  Plant finest(perfect);
  roll(finest, perfect, 0.001);
  ASSERT_EQ(finest.end(), PhysicsEnd::kNone);
  const Extremum peak = finest.extrema().mu_required_max;
  for (const double period_s : {0.001, 0.01, 0.1, 0.5}) {
    for (const double gap : {1e-6, 1e-7, 1e-8, 1e-9, 1e-10}) {
      SCOPED_TRACE("period " + std::to_string(period_s) + " gap 1e" + std::to_string(std::lround(std::log10(gap))));
      const Scenario rough = scenario(peak.value + gap, period_s);
      Plant above(rough);
      roll(above, rough, period_s);
      EXPECT_EQ(above.end(), PhysicsEnd::kNone);
      EXPECT_LE(above.extrema().mu_required_max.value, rough.surface.static_friction);
      EXPECT_NEAR(above.extrema().mu_required_max.value, peak.value,
                  5e-11);  // both know the peak to half the least gap

      const Scenario smooth = scenario(peak.value - gap, period_s);
      Plant below(smooth);
      roll(below, smooth, period_s);
      EXPECT_EQ(below.end(), PhysicsEnd::kSlipped);
      // Where f_s / N is `gap` below its peak: sqrt(2 gap / curvature) before it. The peaks of these runs bend by more
      // than 0.01 per s^2.
      EXPECT_LT(below.time_s(), peak.time_s);
      EXPECT_NEAR(below.time_s(), peak.time_s, std::sqrt(2 * gap / 0.01));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Slip, SlipAtAPeak, testing::Values("paper_ball", "paper_disk"),
                         [](const auto& robot) { return std::string(robot.param); });

// Speeds at which doubles overflow cannot be followed; that is said, not published.
TEST(Inconsistent, StateThatStopsBeingFiniteEndsTheRun) {
  Scenario s = lift({});
  s.ball.inertia_kgm2 = {0.7, 0.8, 0.9};
  s.initial.angular_velocity_B_radps = {1e200, 1e200, 1e200};
  Plant plant(s);
  roll(plant, s, 0.1);
  EXPECT_EQ(plant.end(), PhysicsEnd::kInconsistent);
  EXPECT_FALSE(plant.end_text().empty());
}

}  // namespace
}  // namespace ballast::sim
