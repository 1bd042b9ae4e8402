// The fingerprint: equal for equal scenarios, different for different ones.
#include <map>
#include <set>
#include <utility>

#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

TEST(ScenarioId, ChangesWithEveryField) {
  // One change each, to every key of kFull and to some that it leaves at their default.
  const std::vector<std::string> changes = {"name=other",
                                            "duration=4.5",
                                            "gravity=9.5",
                                            "external_force=[0.5, 0.2, 0.3]",
                                            "external_force=[0.1, 0.5, 0.3]",
                                            "external_force=[0.1, 0.2, 0.5]",
                                            "seed=8",
                                            "ball.radius=2.5",
                                            "ball.mass=3.5",
                                            "ball.inertia=[1.05, 1.1, 1.2]",
                                            "ball.inertia=[1.0, 1.15, 1.2]",
                                            "ball.inertia=[1.0, 1.1, 1.25]",
                                            "ball.center_of_mass=[0.02, 0.02, -0.03]",
                                            "ball.center_of_mass=[0.01, 0.03, -0.03]",
                                            "ball.center_of_mass=[0.01, 0.02, -0.04]",
                                            "surface.static_friction=0.6",
                                            "surface.static_friction=inf",
                                            "surface.kinetic_friction=0.3",
                                            "surface.restitution=0.2",
                                            "surface.rolling_resistance=0.03",
                                            "surface.spin_friction=0.004",
                                            "surface.creep=0.05",
                                            "surface.slope.angle=0.06",
                                            "surface.slope.downhill=0.8",
                                            "mass.0.mass=0.6",
                                            "mass.0.rail.radius=1.6",
                                            "mass.0.rail.direction.azimuth=0.35",
                                            "mass.0.rail.direction.elevation=0.45",
                                            "mass.0.initial_position=0.3",
                                            "mass.0.initial_velocity=0.2",
                                            "mass.0.motion.0.duration=0.6",
                                            "mass.0.motion.0.acceleration=[1.5, 2.0]",
                                            "mass.0.motion.1.acceleration=[2.0, -3.5]",
                                            "mass.0.motion=[]",
                                            "mass.0.motor.steps_per_revolution=200",
                                            "mass.0.motor.microsteps=16",
                                            "mass.0.motor.gear_ratio=3.5",
                                            "mass.0.motor.holding_torque=31",
                                            "mass.0.motor.detent_torque=0.6",
                                            "mass.0.motor.rotor_inertia=0.002",
                                            "mass.0.motor.viscous_damping=0.3",
                                            "mass.0.motor.corner_speed=41",
                                            "mass.0.motor.step_error=0.03",
                                            "mass.0.motor.max_step_rate=12001",
                                            "mass.0.motor.max_acceleration=6",
                                            "mass.0.motor.direction_setup=3e-6",
                                            "mass.0.motor.max_jerk=60",
                                            "mass.1.rail.origin=[0, 0.1, -0.2]",
                                            "mass.1.rail.direction=[2, 1, 0]",
                                            "mass.1.motor.travel_per_revolution=0.6",
                                            "mass.2.rail.center=[0, 0.1, 0.1]",
                                            "mass.2.rail.axes=[[0, 0, 1], [1, 0, 0]]",
                                            "mass.2.rail.axes=[[1, 0, 0], [0, 1, 0]]",
                                            "initial.orientation=[0.8, 0.6, 0, 0]",
                                            "initial.orientation=[0.6, -0.8, 0, 0]",
                                            "initial.orientation=[0.6, 0, 0.8, 0]",
                                            "initial.orientation=[0.6, 0, 0, 0.8]",
                                            "initial.angular_velocity=[0.2, 0.2, 0.3]",
                                            "initial.angular_velocity=[0.1, 0.3, 0.3]",
                                            "initial.angular_velocity=[0.1, 0.2, 0.4]",
                                            "initial.position=[1.5, 2]",
                                            "initial.position=[1, 2.5]",
                                            "run.actuation=prescribed",
                                            "run.control_period=0.0021",
                                            "run.timer_frequency=2e6",
                                            "envelope.min_normal_force=1.5",
                                            "envelope.friction_use=0.8",
                                            "control.tracking=true",
                                            "control.governor=true",
                                            "gravity=9.000000000000002"};
  std::map<std::int64_t, std::string> seen = {{accepted(kFull).id, "unchanged"}};
  for (const std::string& change : changes) {
    const std::int64_t id = accepted(kFull, {change}).id;
    const auto [other, fresh] = seen.emplace(id, change);
    EXPECT_TRUE(fresh) << change << " has the id of " << other->second;
    EXPECT_NE(id, 0);
  }
}

// A plan is tracked by default, from the start that it states.
TEST(ScenarioId, ChangesWithAPlanThatIsTracked) {
  const auto with = [](const std::string& plan, bool tracked) {
    return accepted(kFull, {"plan=" + plan, tracked ? "control.tracking=true" : "control.tracking=false"}).id;
  };
  const std::string start = "start={orientation=[1, 0, 0, 0], angular_velocity=[0, 0, 0], position=[0, 0]}";
  std::set<std::int64_t> ids{accepted(kFull).id, with("{goal=[1, 0]}", true), with("{" + start + "}", true)};
  for (const auto& [from, to] : {std::pair("[1, 0, 0, 0]", "[0, 1, 0, 0]"), std::pair("[0, 0, 0]", "[0, 0, 1]"),
                                 std::pair("[0, 0]}", "[0, 1]}")}) {
    ids.insert(with("{" + replaced(start, from, to) + "}", true));
  }
  EXPECT_EQ(ids.size(), 6u);
  EXPECT_EQ(with("{" + start + "}", false), accepted(kFull).id) << "not tracked: nothing reads it";
  EXPECT_EQ(accepted(kFull, {"plan={goal=[1, 0]}"}).id, with("{goal=[1, 0]}", true)) << "the default";
}

TEST(ScenarioId, ChangesWithTheGovernorsFrictionWhereItIsOn) {
  const auto id = [](const std::string& governor, const std::string& use) {
    return accepted(kFull, {"control.governor=" + governor, "control.friction_use=" + use}).id;
  };
  EXPECT_NE(id("true", "0.9"), id("true", "0.8"));
  EXPECT_EQ(id("false", "0.9"), accepted(kFull).id) << "off: nothing reads it";
}

TEST(ScenarioId, ChangesWithDeclaredErrorsWhereTheGovernorIsOn) {
  const auto id = [](const std::string& governor, const std::string& error) {
    return accepted(kFull, {"control.governor=" + governor, "control.belief_error=" + error}).id;
  };
  const std::set<std::int64_t> ids{id("true", "{}"), id("true", "{mass=0.1}"), id("true", "{center_of_mass=0.1}"),
                                   id("true", "{mass=0.1, center_of_mass=0.1}")};
  EXPECT_EQ(ids.size(), 4u);
  EXPECT_EQ(id("true", "{mass=0, center_of_mass=0}"), id("true", "{}")) << "nothing is declared";
  EXPECT_EQ(id("false", "{mass=0.1}"), accepted(kFull).id) << "off: nothing reads it";
}

TEST(ScenarioId, ChangesWithTheMassesAndTheirOrder) {
  const std::string line =
      "[[mass]]\nmass = 1\nrail = { shape = \"line\", origin = [0, 0, 0], direction = [1, 0, 0] }\n";
  const std::string other = replaced(line, "mass = 1", "mass = 2");
  const std::vector<std::int64_t> ids = {accepted(kMinimal).id, accepted(kMinimal + line).id,
                                         accepted(kMinimal + line + other).id, accepted(kMinimal + other + line).id};
  for (std::size_t i = 0; i < ids.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) EXPECT_NE(ids[i], ids[j]) << i << " " << j;
  }
}

TEST(ScenarioId, IgnoresHowTheFileIsWritten) {
  const std::int64_t id = accepted(kMinimal).id;
  EXPECT_EQ(accepted("# a comment\n\n" + kMinimal + "\n# another\n").id, id);
  EXPECT_EQ(accepted(replaced(kMinimal, "duration = 4.0", "  duration=4.00e0   # s")).id, id);
  EXPECT_EQ(accepted("gravity = 1\nball = { inertia = [1, 1.1, 1.2], mass = 3, radius = 2 }\nduration = 4\n").id, id);
  EXPECT_EQ(accepted(kMinimal, {"gravity=1.0"}).id, id);
  // Defaults written out, either zero, and the rolling velocity of a ball at rest are no difference.
  EXPECT_EQ(accepted(kMinimal, {"surface.restitution=0.0", "run.control_period=0.001", "name=test"}).id, id);
  EXPECT_EQ(accepted(kMinimal, {"initial.position=[-0.0, 0]"}).id, id);
  EXPECT_EQ(accepted(kMinimal, {"surface={creep=0.1, slope={angle=0, downhill=1}}"}).id, id) << "an ideal floor";
  EXPECT_EQ(accepted(kMinimal, {"initial.velocity=[0, 0, 0]"}).id, id);
  EXPECT_EQ(parse_scenario(kMinimal, "elsewhere/test.toml").scenario.id, id);
}

TEST(ScenarioId, IsNotSetForAFaultyScenario) { EXPECT_EQ(parse(kMinimal, {"gravity=-1"}).scenario.id, 0); }

}  // namespace
}  // namespace ballast::sim
