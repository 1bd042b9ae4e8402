// Parameters that are identified from recorded runs, and those that are not. The runs are made here; the fit is given
// what the robot knew.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>

#include "sim/plant/plant.h"
#include "tests/identify/study.h"
#include "tools/identify/excite.h"
#include "tools/identify/words.h"

namespace ballast::identify_test {
namespace {

using identify::Identified;
using identify::Known;
using identify::Parameters;

const std::string kScenarios = BALLAST_SCENARIO_DIR;
const std::vector<std::string> kImu{"sensors.preset=bmi088_calibrated"};

sim::Scenario desk_ball(std::vector<std::string> overrides = {}) {
  overrides.insert(overrides.begin(), kImu.begin(), kImu.end());
  const sim::ScenarioResult read = sim::read_scenario(kScenarios + "/desk_ball.toml", overrides);
  EXPECT_TRUE(read.ok()) << to_string(read.errors.front());
  return read.scenario;
}

Known known_of(const sim::Scenario& scenario) {
  Known known;
  EXPECT_EQ(identify::know(scenario, known), "");
  return known;
}

Identified fitted(const Parameters& parameters, const identify::Recording& recording) {
  const identify::FitOutcome outcome = identify::fit(parameters, {recording});
  EXPECT_TRUE(outcome.fit) << outcome.trouble;
  return outcome.fit.value_or(Identified{});
}

// Two candidates are enough for a motion that shows everything; the command tries more.
sim::Scenario excited(const sim::Scenario& nominal) {
  const Known known = known_of(nominal);
  const Parameters parameters(known, known.scale_mass_kg);
  identify::ExciteOptions options;
  options.candidates = 2;
  options.friction_use = 0.25;  // so gentle that the controller measures no slip
  const auto found = identify::excitations(nominal, known, parameters, options);
  EXPECT_FALSE(found.empty());
  if (found.empty()) return nominal;
  const auto read = sim::parse_scenario(identify::excite_toml(nominal.toml, nominal.name, found.front()), "excite");
  EXPECT_TRUE(read.ok()) << to_string(read.errors.front());
  return read.scenario;
}

// The model under the commanded motion goes where the plant goes with ideal masses. Both are good to 1e-6 of the
// motion: the plant leads its masses along cubics between ticks, and the model's steps have that error.
TEST(Identify, RollsAsThePlantDoes) {
  const sim::Scenario scenario = desk_ball({"run.actuation=ideal", "duration=4"});
  const Recorded run = record(scenario);
  const Known known = run.recording.known;
  const identify::Timeline timeline(run.recording.commanded, known);
  std::vector<identify::Node> nodes;
  identify::roll(known.robot, Eigen::Vector3d::Zero(), timeline, 0, timeline.windows(), {}, nodes);
  sim::Scenario prescribed = scenario;
  prescribed.run.actuation = sim::Actuation::kPrescribed;
  sim::Plant plant(prescribed);
  plant.advance(timeline.windows() * timeline.window_s(), {});
  const sim::Plant::Sample truth = plant.sample();
  const identify::BallState& state = nodes.back().state;
  EXPECT_NEAR((state.omega_B_radps - truth.angular_velocity_B_radps).norm(), 0, 1e-6);
  EXPECT_NEAR((state.place_W_m - truth.position_W_m.head<2>()).norm(), 0, 1e-6);
  for (std::size_t j = 0; j < 4; ++j) EXPECT_NEAR(state.q[j], truth.orientation[j], 1e-6);
}

// Masses and inertias of one factor move alike: the fit of a robot that is said to weigh twice as much is twice the
// fit. To a part of the intervals, since the iterations end there.
TEST(Identify, TakesTheScaleFromTheTotalMass) {
  std::mt19937_64 random(7);
  const Recorded run = record(built(excited(desk_ball({"run.actuation=ideal"})), {}, random));
  const double total_kg = run.recording.known.scale_mass_kg;
  const Parameters once(run.recording.known, total_kg), twice(run.recording.known, 2 * total_kg);
  const Identified a = fitted(once, run.recording), b = fitted(twice, run.recording);
  for (int k = 0; k < once.count(); ++k) {
    const bool scales = k < once.center_of_mass() || (k >= once.inertia() && k < once.rolling_resistance());
    EXPECT_NEAR(b.value[k], (scales ? 2 : 1) * a.value[k], 0.025 * b.half_width[k]) << once.name(k);
  }
}

// A mass that lags moves otherwise than it is commanded in its speed and acceleration too, also between nodes and at
// both ends. Differences over a window know the acceleration of this swing to 1 %, at the ends to a tenth.
TEST(Identify, MovesMassesWithTheirLag) {
  const Known known = known_of(desk_ball());
  identify::Timeline timeline(std::vector<firmware::MassMotion>(2001), known);
  constexpr double kSize = 1e-3, kRate = 5;  // rad, rad/s
  const int nodes = identify::kStepsPerWindow * timeline.windows() + 1;
  std::vector<plan::PerMass<double>> lag(static_cast<std::size_t>(nodes));
  for (int k = 0; k < nodes; ++k) lag[static_cast<std::size_t>(k)][1] = kSize * std::sin(kRate * k * timeline.step_s());
  timeline.set_lag(lag);
  timeline.place({0, 0.1}, {0, 0.5});
  const int last = 2 * (nodes - 1);
  for (int half = 0; half <= last; ++half) {
    const double phase = kRate * half * timeline.step_s() / 2;
    const bool inside = half > identify::kStepsPerWindow && half < last - identify::kStepsPerWindow;
    const double part = inside ? 0.01 : 0.1;
    const firmware::MassMotion& at = timeline.at_half(half);
    EXPECT_NEAR(at.position[1], 0.1 - 0.5 * kSize * std::sin(phase), 1e-3 * kSize);
    EXPECT_NEAR(at.velocity[1], -0.5 * kSize * kRate * std::cos(phase), part * kSize * kRate);
    EXPECT_NEAR(at.acceleration[1], 0.5 * kSize * kRate * kRate * std::sin(phase), part * kSize * kRate * kRate);
    EXPECT_EQ(at.position[0], 0);
    EXPECT_EQ(at.velocity[2], 0);
  }
}

// The bar of the command, for one robot: the study of identify.md has many. Masses within 1 %, the centre of mass
// within 1 % of the radius, inertias within 2 %, twice the study's worst; nothing twice its interval off, which is 8
// sigma of the residuals.
TEST(Identify, FindsARobotThatWasBuiltWithErrors) {
  const sim::Scenario nominal = excited(desk_ball());
  std::mt19937_64 random(4);
  // Masses far off are still measured as slip now and then, which ends a run early.
  const sim::Scenario robot = built(nominal, {.mass = 0.05, .inertia = 0.05, .rolling_resistance = 0}, random);
  const Recorded run = record(robot);
  const Parameters parameters(run.recording.known, run.recording.known.scale_mass_kg);
  const Identified fit = fitted(parameters, run.recording);
  ASSERT_EQ(fit.value.size(), parameters.count());
  const Eigen::VectorXd true_values = truth(parameters, robot);
  EXPECT_TRUE(fit.unknown.empty());
  for (int k = 0; k < parameters.count(); ++k) {
    const double off = std::abs(fit.value[k] - true_values[k]);
    EXPECT_LT(off, 2 * fit.half_width[k]) << parameters.name(k);
    if (k < parameters.masses()) {
      EXPECT_LT(off, 0.01 * true_values[k]) << parameters.name(k);
    } else if (k < parameters.inertia()) {
      EXPECT_LT(off, 0.01 * robot.ball.radius_m) << parameters.name(k);
    } else if (k < parameters.rolling_resistance()) {
      EXPECT_LT(off, 0.02 * true_values[k]) << parameters.name(k);
    }
  }
}

// A ball whose masses hang still says nothing of them: all stays as it is believed.
TEST(Identify, KeepsTheBeliefOfWhatIsNotExcited) {
  sim::Scenario nominal = desk_ball({"duration=4"});
  for (sim::Mass& mass : nominal.masses) mass.motion.clear();
  std::mt19937_64 random(3);
  const Recorded run = record(built(nominal, {.center_of_mass = 0, .rolling_resistance = 0}, random));
  const Parameters parameters(run.recording.known, run.recording.known.scale_mass_kg);
  const Identified fit = fitted(parameters, run.recording);
  EXPECT_FALSE(fit.unknown.empty());
  for (int k = 0; k < parameters.masses(); ++k) EXPECT_TRUE(std::isinf(fit.half_width[k])) << parameters.name(k);
  for (int k = parameters.inertia(); k < parameters.rolling_resistance(); ++k)
    EXPECT_TRUE(std::isinf(fit.half_width[k])) << parameters.name(k);
  // The belief is written for them.
  const auto read =
      sim::parse_scenario(identify::believed_toml(nominal.toml, parameters, run.recording.known, fit), "identified");
  ASSERT_TRUE(read.ok()) << to_string(read.errors.front());
  for (std::size_t i = 0; i < nominal.masses.size(); ++i)
    EXPECT_EQ(read.scenario.belief().masses[i].mass_kg, nominal.masses[i].mass_kg);
  EXPECT_EQ(read.scenario.belief().ball.inertia_kgm2, nominal.ball.inertia_kgm2);
  EXPECT_EQ(read.scenario.control.belief_error.mass_share, 0) << "nobody knows";
}

TEST(Identify, WritesABeliefThatLoads) {
  const sim::Scenario nominal = desk_ball({"believed.surface.static_friction=0.45"});
  const Known known = known_of(nominal);
  const Parameters parameters(known, known.scale_mass_kg);
  Identified fit;
  fit.value = 1.01 * parameters.believed();
  fit.value[parameters.center_of_mass()] = 1e-3;
  fit.half_width = Eigen::VectorXd::Constant(parameters.count(), 1e-4);
  fit.half_width[1] = std::numeric_limits<double>::infinity();
  fit.shell_mass_kg = parameters.shell_mass_kg(fit.value);
  fit.half_width[parameters.center_of_mass() + 1] = 3e-4;
  const auto read = sim::parse_scenario(identify::believed_toml(nominal.toml, parameters, known, fit), "identified");
  ASSERT_TRUE(read.ok()) << to_string(read.errors.front());
  const sim::World& belief = read.scenario.belief();
  EXPECT_TRUE(read.scenario.belief_is_written);
  EXPECT_EQ(belief.masses[0].mass_kg, fit.value[0]);
  EXPECT_EQ(belief.masses[1].mass_kg, nominal.masses[1].mass_kg);  // unknown
  EXPECT_EQ(belief.ball.mass_kg, fit.shell_mass_kg);
  EXPECT_EQ(belief.ball.center_of_mass_B_m[0], 1e-3);
  EXPECT_EQ(belief.ball.inertia_kgm2[2], fit.value[parameters.inertia() + 2]);
  EXPECT_EQ(belief.surface.static_friction, 0.45);  // was believed before
  EXPECT_EQ(read.scenario.control.belief_error.mass_share, 0) << "a mass is unknown";
  EXPECT_EQ(read.scenario.control.belief_error.center_of_mass_m, 3e-4);
  EXPECT_EQ(identify::declared_text(identify::belief_error(parameters, fit)),
            "  declared    control.belief_error.mass stays as it was: " + parameters.name(1) +
                " is unknown\n"
                "  declared    control.belief_error.center_of_mass = 0.0003 m, by ball.center_of_mass.1\n");
  fit.half_width[1] = 1e-4;
  const auto known_all =
      sim::parse_scenario(identify::believed_toml(nominal.toml, parameters, known, fit), "identified");
  ASSERT_TRUE(known_all.ok()) << to_string(known_all.errors.front());
  // The least moment of inertia has the widest interval by its part.
  EXPECT_EQ(known_all.scenario.control.belief_error.mass_share,
            1e-4 / fit.value.segment<3>(parameters.inertia()).minCoeff());
  fit.half_width[0] = 0.6 * fit.value[0];
  const std::string declared = identify::declared_text(identify::belief_error(parameters, fit));
  EXPECT_NE(declared.find("control.belief_error.mass stays as it was: " + parameters.name(0) +
                          " may be off by 60 %, and at most 50 % can be declared\n"),
            std::string::npos)
      << declared;
  const auto too_wide =
      sim::parse_scenario(identify::believed_toml(nominal.toml, parameters, known, fit), "identified");
  ASSERT_TRUE(too_wide.ok()) << to_string(too_wide.errors.front());
  EXPECT_EQ(too_wide.scenario.control.belief_error.mass_share, 0);
  EXPECT_EQ(read.scenario.ball.mass_kg, nominal.ball.mass_kg);
  EXPECT_NE(read.scenario.id, nominal.id);
}

TEST(Identify, RefusesWhatCannotTell) {
  Known known;
  const auto why = [&](const std::vector<std::string>& overrides) {
    const auto read = sim::read_scenario(kScenarios + "/desk_ball.toml", overrides);
    EXPECT_TRUE(read.ok());
    return identify::know(read.scenario, known);
  };
  EXPECT_NE(why({}).find("sensors: there is no IMU"), std::string::npos);
  EXPECT_NE(why({kImu.front(), "run.actuation=prescribed"}).find("run.actuation"), std::string::npos);
  EXPECT_NE(why({kImu.front(), "gravity=0"}).find("gravity"), std::string::npos);
  EXPECT_EQ(why(kImu), "");
}

TEST(Identify, TellsRobotsApart) {
  const Known desk = known_of(desk_ball());
  EXPECT_EQ(identify::other_robot(desk, known_of(desk_ball({"duration=3", "seed=4"}))), "");
  EXPECT_NE(identify::other_robot(desk, known_of(desk_ball({"mass.1.mass=0.3"}))), "");
  EXPECT_NE(identify::other_robot(desk, known_of(desk_ball({"mass.2.rail.radius=0.04"}))), "");
  EXPECT_NE(identify::other_robot(desk, known_of(desk_ball({"ball.radius=0.16"}))), "");
}

// Messages of a run whose masses stand.
struct Messages {
  sensors_t sensors{};
  controller_status_t status{};
  void next(identify::Collector& collector) {
    sensors.imu_count += 1;
    sensors.imu_tick = sensors.tick;
    collector.take(sensors);
    collector.take(status);
    ++sensors.tick;
    ++status.tick;
  }
};

TEST(Identify, UsesARunUpToWhereItLostTheFloor) {
  const Known known = known_of(desk_ball());
  const auto collected = [&](const auto& change) {
    identify::Collector collector(known);
    Messages messages;
    messages.sensors.tick = messages.status.tick = -1;
    for (int tick = -1; tick < 2000; ++tick) {
      if (tick == 1500) change(messages);
      messages.next(collector);
    }
    return std::move(collector).finish();
  };
  const auto whole = collected([](Messages&) {});
  EXPECT_EQ(whole.cut, "");
  EXPECT_EQ(whole.commanded.size(), 2000u);
  EXPECT_EQ(whole.imu.size(), 2000u);
  const auto slipped = collected([](Messages& m) { m.status.slip_detected = 1; });
  EXPECT_EQ(slipped.cut, "the controller has measured slip");
  EXPECT_LT(slipped.commanded.size(), 1000u);
  EXPECT_GT(slipped.commanded.size(), 800u);
  EXPECT_EQ(slipped.imu.size(), slipped.commanded.size());
  EXPECT_NE(collected([](Messages& m) { m.status.light_detected = 1; }).cut, "");
  EXPECT_EQ(collected([](Messages& m) { m.status.mode = controller_status_t::MODE_TRIPPED; }).cut,
            "the controller has tripped");
  const auto gap = collected([](Messages& m) { ++m.status.tick; });
  EXPECT_EQ(gap.cut, "the controller's status of tick 1501 follows that of tick 1499");
  EXPECT_EQ(gap.commanded.size(), 1500u);
}

TEST(Identify, NeedsSomeSecondsAndTheirSamples) {
  const Recorded run = record(desk_ball({"duration=2.5", "run.actuation=ideal"}));
  const Parameters parameters(run.recording.known, run.recording.known.scale_mass_kg);
  identify::Recording brief = run.recording;
  brief.commanded.resize(1000);
  EXPECT_NE(identify::fit(parameters, {brief}).trouble.find("can be used; allowed: at least"), std::string::npos);
  identify::Recording deaf = run.recording;
  deaf.imu.resize(deaf.imu.size() / 3);
  EXPECT_NE(identify::fit(parameters, {deaf}).trouble.find("missing or saturated"), std::string::npos);
}

TEST(Identify, ReadsOnlyFoldersOfRuns) {
  const identify::ReadRun read = identify::read_run("/nonexistent");
  EXPECT_FALSE(read.recording);
  EXPECT_TRUE(read.usage);
  EXPECT_EQ(read.trouble, "/nonexistent: no folder of a run");
}

}  // namespace
}  // namespace ballast::identify_test
