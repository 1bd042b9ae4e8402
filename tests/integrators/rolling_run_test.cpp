// The paper's runs by every method, against tests/data (an independent program: tests/physics/plant_reference_test.cpp)
// and against the firmware's closed forms integrated by CVODE (tests/physics/closed_form_run.h).
#include "tools/integrators/rolling_run.h"

#include <gtest/gtest.h>

#include "tests/data/reference.h"
#include "tests/physics/closed_form_run.h"
#include "tests/physics/random_robot.h"

namespace ballast::integrators {
namespace {

using Row = test::ReferenceRow;

sim::Scenario shipped(const std::string& name, std::vector<std::string> overrides = {}) {
  overrides.emplace_back("run.actuation=\"prescribed\"");
  auto result = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides);
  for (const auto& error : result.errors) ADD_FAILURE() << to_string(error);
  return result.scenario;
}

double state_error(const sim::Plant::Sample& s, const Row& row) {
  const Eigen::Vector4d q(row.at("q_w"), row.at("q_x"), row.at("q_y"), row.at("q_z"));
  const Eigen::Vector3d omega(row.at("Omega_1"), row.at("Omega_2"), row.at("Omega_3"));
  const Eigen::Vector2d z(row.at("z_1"), row.at("z_2"));
  return std::max({std::min((s.orientation - q).norm(), (s.orientation + q).norm()),
                   (s.angular_velocity_B_radps - omega).norm(), (s.position_W_m.head<2>() - z).norm()});
}

double ratio(const firmware::RollingForces& forces) { return forces.static_friction_n / forces.normal_force_n; }

// The peak of f_s / N near `near_s` by the closed forms: the parabola through three samples 2e-3 apart. What it leaves
// out, the fourth derivative (some tens) times h^4 / 24, is below 1e-10.
double closed_form_peak(const sim::Scenario& scenario, double near_s) {
  constexpr double kH = 2e-3;
  test::ClosedFormRun run(scenario);
  double v[3];
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(run.advance(near_s + (i - 1) * kH));
    v[i] = ratio(run.forces());
  }
  const double slope = (v[2] - v[0]) / 2, bend = v[2] - 2 * v[1] + v[0];
  return v[1] - slope * slope / (2 * bend);
}

// The instant at which f_s / N passes `limit` between from_s and from_s + 4 h: by the cubic through four samples of the
// inverse function; h^4 times its fourth derivative is below 1e-10.
double closed_form_crossing(const sim::Scenario& scenario, double limit, double from_s, double h) {
  test::ClosedFormRun run(scenario);
  double t[4], v[4];
  for (int i = 0; i < 4; ++i) {
    EXPECT_TRUE(run.advance(t[i] = from_s + i * h));
    v[i] = ratio(run.forces());
  }
  EXPECT_LT(v[0], limit);
  EXPECT_GT(v[3], limit);
  double at = 0;
  for (int i = 0; i < 4; ++i) {
    double weight = t[i];
    for (int j = 0; j < 4; ++j) {
      if (j != i) weight *= (limit - v[j]) / (v[i] - v[j]);
    }
    at += weight;
  }
  return at;
}

struct Case {
  std::string method, scenario;
  double tolerance;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.method << " on " << c.scenario << " at " << c.tolerance; }

// The paper's tolerances. On the ball, whose motion multiplies errors by about 1e2, the methods of order 2 come nearest
// to the bar of 1e-7 below: to half of it.
std::vector<Case> cases() {
  std::vector<Case> out;
  for (const auto& info : all_methods()) {
    out.push_back({info.name, "paper_ball", 1e-10});
    out.push_back({info.name, "paper_disk", 1e-12});
  }
  return out;
}

Settings settings_for(const sim::Scenario& scenario, const MethodInfo& info, double tolerance) {
  const bool fixed = info.fixed_steps == FixedSteps::kAlways;
  return {.tolerance = tolerance, .fixed_step_s = fixed ? fixed_step_for(scenario, tolerance) : 0};
}

RollingRun run(const sim::Scenario& scenario, const std::string& method, double tolerance) {
  const MethodInfo& info = *find_method(method);
  return run_rolling(scenario, info, settings_for(scenario, info, tolerance));
}

class PaperRun : public testing::TestWithParam<Case> {};

TEST_P(PaperRun, EndsWhereTheReferenceDoesAndNeedsTheSameFriction) {
  const auto& [method, name, tolerance] = GetParam();
  const sim::Scenario scenario = shipped(name);
  const RollingRun result = run(scenario, method, tolerance);
  ASSERT_EQ(result.failure, "");
  EXPECT_EQ(result.result.end_reason, sil::EndReason::kCompleted);
  EXPECT_LT(state_error(result.result.final_sample, test::reference_rows(name).back()), 1e-7);

  // Eight digits. The peaks are near these times.
  const sim::Extremum& most = result.result.extrema.mu_required_max;
  static const double kBall = closed_form_peak(shipped("paper_ball"), 6.4376);
  static const double kDisk = closed_form_peak(shipped("paper_disk"), 19.3974);
  EXPECT_NEAR(most.value, name == "paper_ball" ? kBall : kDisk, 5e-9);

  // The versor: |q|^2 = 1 is a constraint of the DAE, met to what Newton's iteration leaves; what it drifts by in the
  // ODE is part of the method's error.
  const bool dae = find_method(method)->form == Form::kDae;
  EXPECT_LT(result.constraint_error, dae ? 1e-9 : 1e-7);
}

INSTANTIATE_TEST_SUITE_P(Methods, PaperRun, testing::ValuesIn(cases()),
                         [](const auto& run) { return run.param.scenario + "_" + run.param.method; });

// Inside the run too: N and the friction force at the reference's row nearest to the greatest f_s / N.
TEST(RollingRun, ForcesAreTheReferences) {
  for (const auto& row : test::reference_rows("paper_ball")) {
    if (std::abs(row.at("t") - 6.4) > 0.01) continue;
    const RollingRun result = run(shipped("paper_ball", {"duration=6.4"}), kDefaultMethod, 1e-10);
    const auto& s = result.result.final_sample;
    EXPECT_NEAR(s.normal_force_n, row.at("N"), 1e-8);  // forces of some units from a state good to 1e-9
    EXPECT_NEAR(s.friction_force_W_n[0], row.at("f_1"), 1e-8);
    EXPECT_NEAR(s.friction_force_W_n[1], row.at("f_2"), 1e-8);
    return;
  }
  FAIL() << "no row at t = 6.4";
}

TEST(RollingRun, TheHeavyMassDetachesWhereTheReferenceDoes) {
  const RollingRun result = run(shipped("paper_detach"), kDefaultMethod, 1e-10);
  EXPECT_EQ(result.result.end_reason, sil::EndReason::kDetached);
  EXPECT_TRUE(result.result.rolling_lost);
  EXPECT_NEAR(result.result.final_sample.time_s, 3.609500738, 1e-9);
  EXPECT_NEAR(result.result.final_sample.time_s, test::reference_rows("paper_detach").back().at("t"), 1e-9);
  EXPECT_LE(result.result.final_sample.normal_force_n, 0);
  EXPECT_GT(result.result.final_sample.normal_force_n, -1e-10);  // N falls at 40 per time unit; located to 1e-14
}

TEST(RollingRun, OnGlassTheBallSlipsWhereTheClosedFormsSay) {
  const double slip_s = closed_form_crossing(shipped("paper_ball"), 0.17, 5.637, 2e-3);
  const RollingRun result = run(shipped("paper_ball", {"surface.static_friction=0.17"}), kDefaultMethod, 1e-10);
  EXPECT_EQ(result.result.end_reason, sil::EndReason::kSlipped);
  EXPECT_NEAR(result.result.final_sample.time_s, slip_s, 1e-9);
  EXPECT_GE(result.result.extrema.mu_required_max.value, 0.17);
}

// The run ends where rolling ends, also where the scenario would go on; at loose tolerance too it ends once.
TEST(RollingRun, EndsWhereRollingEndsWhateverTheScenarioSays) {
  for (const auto& info : all_methods()) {
    SCOPED_TRACE(info.name);
    const RollingRun result =
        run(shipped("paper_ball", {"surface.static_friction=0.17", "run.on_violation=\"continue\""}), info.name, 1e-7);
    EXPECT_EQ(result.result.end_reason, sil::EndReason::kSlipped);
    EXPECT_NEAR(result.result.final_sample.time_s, 5.6395731, 1e-3);
    EXPECT_GE(ratio({.normal_force_n = result.result.final_sample.normal_force_n,
                     .static_friction_n = result.result.final_sample.static_friction_n}),
              0.17);
  }
}

// A whole other way to the same: the plant integrates every tick by itself. 1e-11 per step grows by some 1e3 over a
// run.
TEST(RollingRun, RandomRobotsRollAsInThePlant) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    test::RandomRobot robot(seed);
    sim::Scenario scenario = robot.scenario(robot.integer(0, 4));
    scenario.run.on_violation = sim::OnViolation::kStop;
    sim::Plant plant(scenario);
    for (int k = 1; plant.end() == sim::PhysicsEnd::kNone && plant.time_s() < scenario.duration_s; ++k) {
      plant.advance(std::min(scenario.duration_s, k * scenario.run.control_period_s), {});
    }
    const RollingRun result = run(scenario, kDefaultMethod, 1e-11);
    const auto sample = plant.sample();
    const auto& here = result.result.final_sample;
    ASSERT_EQ(result.failure, "");
    EXPECT_EQ(result.result.end_reason == sil::EndReason::kDetached, plant.end() == sim::PhysicsEnd::kDetached);
    EXPECT_NEAR(here.time_s, sample.time_s, 1e-8);
    EXPECT_LT((here.position_W_m - sample.position_W_m).norm(), 1e-7);
    EXPECT_LT((here.angular_velocity_B_radps - sample.angular_velocity_B_radps).norm(), 1e-7);
    const auto &x = result.result.extrema, &y = plant.extrema();
    const double weight = sample.normal_force_n + scenario.gravity_mps2;
    EXPECT_NEAR(x.normal_force_min.value, y.normal_force_min.value, 1e-7 * weight);
    EXPECT_NEAR(x.normal_force_max.value, y.normal_force_max.value, 1e-7 * weight);
    EXPECT_NEAR(x.static_friction_max.value, y.static_friction_max.value, 1e-7 * weight);
    if (std::isfinite(y.mu_required_max.value)) {
      EXPECT_NEAR(x.mu_required_max.value, y.mu_required_max.value, 1e-7 * (1 + y.mu_required_max.value));
    }
    // Sampled, here at the steps and between them, there at the ticks.
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      EXPECT_NEAR(result.result.motor_extrema[i].max_torque_nm, plant.motor_extrema(static_cast<int>(i)).max_torque_nm,
                  0.05 * plant.motor_extrema(static_cast<int>(i)).max_torque_nm);
    }
  }
}

// A mass on a trajectory, a gust and drag; a mass on a spline rail. The latter's knots are no kinks to restart at, and
// the third derivative of zeta jumps there: methods of high order lose some digits (on seam_ball dop853 ends 3e-8 off,
// and its interpolant 2e-6 in N).
TEST(RollingRun, TrajectoriesForcesAndSplineRailsAreThePlants) {
  for (const char* name : {"tumbleweed", "seam_ball"}) {
    SCOPED_TRACE(name);
    const sim::Scenario scenario = shipped(name);
    sim::Plant plant(scenario);
    plant.advance(scenario.duration_s, {});
    const RollingRun result = run(scenario, kDefaultMethod, 1e-10);
    ASSERT_EQ(result.failure, "");
    EXPECT_EQ(result.result.end_reason, sil::EndReason::kCompleted);
    const auto &here = result.result.final_sample, there = plant.sample();
    EXPECT_LT((here.position_W_m - there.position_W_m).norm(), 5e-7);
    EXPECT_LT((here.mass_position_B_m[0] - there.mass_position_B_m[0]).norm(), 1e-12);
    EXPECT_NEAR(result.result.extrema.normal_force_min.value, plant.extrema().normal_force_min.value, 1e-5);
    EXPECT_NEAR(result.result.extrema.mu_required_max.value, plant.extrema().mu_required_max.value, 1e-7);
  }
}

TEST(RollingRun, IsTheSameToTheLastBitEveryTime) {
  for (const auto& info : all_methods()) {
    SCOPED_TRACE(info.name);
    const sim::Scenario scenario = shipped("paper_ball", {"duration=3"});
    const RollingRun first = run(scenario, info.name, 1e-8), second = run(scenario, info.name, 1e-8);
    EXPECT_EQ(first.end_state, second.end_state);
    EXPECT_EQ(first.result.extrema.mu_required_max.value, second.result.extrema.mu_required_max.value);
    EXPECT_EQ(first.counters.right_hand_sides, second.counters.right_hand_sides);
    // The integration alone is the same integration.
    const BareRun bare = integrate_only(scenario, info, settings_for(scenario, info, 1e-8), 3);
    EXPECT_EQ(first.end_state, bare.end_state);
    EXPECT_EQ(first.counters.steps, bare.counters.steps);
    EXPECT_EQ(first.counters.right_hand_sides, bare.counters.right_hand_sides);
  }
}

// Rolling by half turns q_0 through 0, where the paper's choice of the constraint's row makes the DAE singular.
TEST(RollingProblem, TakesTheConstraintsRowWhereTheQuaternionIsLargest) {
  const sim::Scenario scenario = shipped("paper_disk");
  RollingProblem problem(scenario, Form::kDae);
  const double at_rest[9] = {1, 0, 0, 0}, turned[9] = {0.39, 0, 0.92, 0}, little[9] = {0.5, 0, 0.86, 0};
  EXPECT_TRUE(problem.choose_constraint(at_rest));
  EXPECT_EQ(problem.constraint(), 0);
  EXPECT_FALSE(problem.choose_constraint(little));
  EXPECT_TRUE(problem.choose_constraint(turned));
  EXPECT_EQ(problem.constraint(), 2);
  double f[9], jacobian[81];
  problem.rhs(0, turned, f);
  EXPECT_DOUBLE_EQ(f[2], 0.39 * 0.39 + 0.92 * 0.92 - 1);
  problem.jacobian(0, turned, jacobian);
  for (int k = 0; k < 9; ++k) EXPECT_EQ(jacobian[2 + 9 * k], 2 * (k < 4 ? turned[k] : 0));
  RollingProblem ode(scenario, Form::kOde);
  EXPECT_FALSE(ode.choose_constraint(at_rest));
  EXPECT_EQ(ode.constraint(), -1);
}

TEST(WhyNotRolling, SaysHowAScenarioStarts) {
  EXPECT_EQ(why_not_rolling(shipped("paper_ball")), "");
  EXPECT_EQ(why_not_rolling(shipped("paper_ball", {"initial.velocity=[0,0,0]"})), "");  // the rolling velocity
  EXPECT_NE(why_not_rolling(shipped("paper_ball", {"initial.velocity=[1,0,0]"})).find("sliding"), std::string::npos);
  EXPECT_NE(why_not_rolling(shipped("paper_ball", {"initial.velocity=[0,0,1]"})).find("leaving"), std::string::npos);
  EXPECT_NE(why_not_rolling(shipped("paper_ball", {"initial.height=0.1"})).find("in the air"), std::string::npos);
}

}  // namespace
}  // namespace ballast::integrators
