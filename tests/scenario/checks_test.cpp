// The values that a scenario may have, and the errors for others.
#include <cmath>
#include <limits>

#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

TEST(Scenario, ReadsEveryKey) {
  const Scenario s = accepted(kFull);
  EXPECT_EQ(s.name, "full");
  EXPECT_EQ(s.duration_s, 4);
  EXPECT_EQ(s.gravity_mps2, 9);
  EXPECT_EQ(s.external_force_W_n, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(s.seed, 7u);
  EXPECT_EQ(s.ball.radius_m, 2);
  EXPECT_EQ(s.ball.mass_kg, 3);
  EXPECT_EQ(s.ball.inertia_kgm2, Eigen::Vector3d(1, 1.1, 1.2));
  EXPECT_EQ(s.ball.center_of_mass_B_m, Eigen::Vector3d(0.01, 0.02, -0.03));
  EXPECT_EQ(s.surface.static_friction, 0.5);
  EXPECT_EQ(s.surface.kinetic_friction, 0.4);
  EXPECT_EQ(s.surface.restitution, 0.1);
  EXPECT_EQ(s.surface.rolling_resistance, 0.02);
  EXPECT_EQ(s.surface.spin_friction_m, 0.003);
  EXPECT_EQ(s.surface.creep_radps, 0.04);
  EXPECT_EQ(s.surface.slope_rad, 0.05);
  EXPECT_EQ(s.surface.downhill_rad, 0.7);
  ASSERT_EQ(s.masses.size(), 3u);
  const Mass& m = s.masses[0];
  EXPECT_EQ(m.mass_kg, 0.5);
  EXPECT_EQ(m.rail.shape, firmware::RailShape::kCircle);
  EXPECT_EQ(m.rail.radius_m, 1.5);
  EXPECT_EQ(m.initial_position, 0.25);
  EXPECT_EQ(m.initial_velocity, 0.125);
  ASSERT_EQ(m.motion.size(), 2u);
  EXPECT_EQ(m.motion[1].duration_s, 0.25);
  EXPECT_EQ(m.motion[1].acceleration_start, 2);
  EXPECT_EQ(m.motion[1].acceleration_end, -3);
  EXPECT_EQ(m.motor.steps_per_revolution, 400);
  EXPECT_EQ(m.motor.microsteps, 8);
  EXPECT_EQ(m.motor.gear_ratio, 3);
  EXPECT_EQ(m.motor.shaft_ratio, 3);
  EXPECT_EQ(m.motor.holding_torque_nm, 30);
  EXPECT_EQ(m.motor.detent_torque_nm, 0.5);
  EXPECT_EQ(m.motor.rotor_inertia_kgm2, 0.001);
  EXPECT_EQ(m.motor.viscous_damping_nms, 0.25);
  EXPECT_EQ(m.motor.corner_speed_radps, 40);
  EXPECT_EQ(m.motor.step_error, 0.02);
  EXPECT_EQ(m.motor.max_step_rate_hz, 12000);
  EXPECT_EQ(m.motor.max_acceleration, 5);
  EXPECT_EQ(m.motor.max_jerk, 50);
  EXPECT_EQ(s.masses[1].rail.shape, firmware::RailShape::kLine);
  EXPECT_EQ(s.masses[1].motor.travel_per_revolution, 0.5);
  EXPECT_DOUBLE_EQ(s.masses[1].motor.shaft_ratio, 4 * std::acos(-1.0));
  EXPECT_DOUBLE_EQ(s.initial.orientation.w(), 0.6);
  EXPECT_DOUBLE_EQ(s.initial.orientation.x(), 0.8);
  EXPECT_EQ(s.initial.angular_velocity_B_radps, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(s.initial.position_W_m, Eigen::Vector2d(1, 2));
  EXPECT_EQ(s.run.actuation, Actuation::kStepper);
  EXPECT_EQ(s.run.control_period_s, 0.002);
  EXPECT_EQ(s.run.timer_frequency_hz, 1e6);
  EXPECT_EQ(s.run.on_violation, OnViolation::kStop);
  EXPECT_EQ(s.envelope.min_normal_force_n, 1);
  EXPECT_EQ(s.envelope.friction_use, 0.9);
  ASSERT_EQ(s.published.size(), 1u);
  EXPECT_EQ(s.published[0].quantity, "mu_required.max");
  EXPECT_EQ(s.published[0].value, 0.19);
  EXPECT_EQ(s.published[0].source, "somewhere");
  EXPECT_NE(s.id, 0);
}

TEST(Scenario, DefaultsOfEverythingButMasses) {
  const Scenario s = accepted(kMinimal);
  EXPECT_EQ(s.name, "test");  // the file's stem
  EXPECT_EQ(s.external_force_W_n, Eigen::Vector3d::Zero());
  EXPECT_EQ(s.ball.center_of_mass_B_m, Eigen::Vector3d::Zero());
  EXPECT_EQ(s.surface.static_friction, kInf);
  EXPECT_EQ(s.surface.kinetic_friction, kInf);
  EXPECT_EQ(s.surface.restitution, 0);
  EXPECT_EQ(s.surface.rolling_resistance, 0);
  EXPECT_EQ(s.surface.spin_friction_m, 0);
  EXPECT_EQ(s.creep_radps(), 1e-3 * std::sqrt(s.gravity_mps2 / s.ball.radius_m));
  EXPECT_EQ(s.surface.slope_rad, 0);
  EXPECT_TRUE(s.masses.empty());
  EXPECT_EQ(s.initial.orientation.coeffs(), Eigen::Vector4d(0, 0, 0, 1));
  EXPECT_EQ(s.initial.angular_velocity_B_radps, Eigen::Vector3d::Zero());
  EXPECT_EQ(s.initial.position_W_m, Eigen::Vector2d::Zero());
  EXPECT_FALSE(s.initial.has_velocity);
  EXPECT_EQ(s.initial.height_m, 0);
  EXPECT_EQ(s.run.actuation, Actuation::kStepper);
  EXPECT_EQ(s.run.control_period_s, 0.001);
  EXPECT_EQ(s.run.timer_frequency_hz, 1e7);
  EXPECT_EQ(s.run.on_violation, OnViolation::kStop);
  EXPECT_EQ(s.envelope.min_normal_force_n, 0);
  EXPECT_EQ(s.envelope.friction_use, 1);
  EXPECT_EQ(s.seed, 0u);
  EXPECT_TRUE(s.published.empty());
}

TEST(Scenario, KineticFrictionIsTheStaticOneUnlessGiven) {
  EXPECT_EQ(accepted(kMinimal + "[surface]\nstatic_friction = 0.25\n").surface.kinetic_friction, 0.25);
  EXPECT_EQ(accepted(kMinimal + "[surface]\nkinetic_friction = 0.25\n").surface.static_friction, kInf);
  EXPECT_EQ(accepted(kMinimal + "[surface]\nstatic_friction = inf\nkinetic_friction = inf\n").surface.kinetic_friction,
            kInf);
}

// Every way to be out of range or of the wrong type, one by one: the override is the only fault of the scenario.
struct Rejection {
  const char* assignment;
  const char* key;
  const char* allowed;  // part of the message
};

void PrintTo(const Rejection& rejection, std::ostream* out) { *out << rejection.assignment; }

class Rejects : public ::testing::TestWithParam<Rejection> {};

TEST_P(Rejects, WithKeyValueAndWhatIsAllowed) {
  const Rejection& r = GetParam();
  const std::string assignment = r.assignment;
  const ScenarioError error = only_error(kFull, {assignment});
  EXPECT_EQ(error.source, "--set");
  EXPECT_EQ(error.line, 0);
  EXPECT_EQ(error.key, r.key);
  EXPECT_TRUE(contains(error.message, r.allowed));
  EXPECT_TRUE(contains(error.message, "allowed"));
  // The value as written; of an array's element only the element.
  EXPECT_FALSE(error.value.empty());
  EXPECT_TRUE(contains(assignment, error.value));
}

INSTANTIATE_TEST_SUITE_P(
    TopLevel, Rejects,
    ::testing::Values(
        Rejection{"duration=0", "duration", "> 0"}, Rejection{"duration=-1", "duration", "> 0"},
        Rejection{"duration=inf", "duration", "finite"}, Rejection{"duration=nan", "duration", "finite"},
        Rejection{"duration=ten", "duration", "a string"}, Rejection{"duration=true", "duration", "a boolean"},
        Rejection{"duration=[1]", "duration", "an array"}, Rejection{"duration=1979-05-27", "duration", "a date"},
        Rejection{"gravity=-1e-9", "gravity", ">= 0"}, Rejection{"gravity=inf", "gravity", "finite"},
        Rejection{"gravity=nan", "gravity", "finite"},
        Rejection{"external_force=[0,0]", "external_force", "array of 3"},
        Rejection{"external_force=5", "external_force", "array of 3"},
        Rejection{"external_force=[0,0,nan]", "external_force.2", "finite"},
        Rejection{"external_force=[0,\"x\",0]", "external_force.1", "a string"},
        Rejection{"seed=-1", "seed", "[0, 9223372036854775807]"}, Rejection{"seed=1.0", "seed", "an integer"},
        Rejection{"name=\"a/b\"", "name", "letters, digits"}, Rejection{"name=.hidden", "name", "no . at the start"},
        Rejection{"name=5", "name", "not a string"}, Rejection{"name=\"a b\"", "name", "letters"},
        Rejection{"ball=5", "ball", "a table"}, Rejection{"run=[]", "run", "a table"},
        Rejection{"mass=5", "mass", "[[mass]]"}, Rejection{"mass={mass=1}", "mass", "[[mass]]"},
        Rejection{"mass=[1]", "mass.0", "a table"}));

INSTANTIATE_TEST_SUITE_P(
    BallAndSurface, Rejects,
    ::testing::Values(
        Rejection{"ball.radius=\"2\"", "ball.radius", "> 0"}, Rejection{"ball.mass=0", "ball.mass", "> 0"},
        Rejection{"ball.mass=-0.0", "ball.mass", "> 0"}, Rejection{"ball.inertia=[1,1]", "ball.inertia", "array of 3"},
        Rejection{"ball.inertia=[1,0,1]", "ball.inertia.1", "> 0"},
        Rejection{"ball.inertia=[1,1,2.0001]", "ball.inertia.2", "sum of the other two, 2"},
        Rejection{"ball.center_of_mass=[0,0,2]", "ball.center_of_mass", "ball.radius = 2"},
        Rejection{"ball.center_of_mass=[0,0,inf]", "ball.center_of_mass.2", "finite"},
        Rejection{"surface.static_friction=0", "surface.static_friction", "> 0, or inf"},
        Rejection{"surface.static_friction=-inf", "surface.static_friction", "> 0, or inf"},
        Rejection{"surface.static_friction=nan", "surface.static_friction", "> 0, or inf"},
        Rejection{"surface.kinetic_friction=0", "surface.kinetic_friction", "> 0"},
        Rejection{"surface.kinetic_friction=nan", "surface.kinetic_friction", "> 0"},
        Rejection{"surface.kinetic_friction=0.51", "surface.kinetic_friction", "static_friction = 0.5"},
        Rejection{"surface.restitution=1.01", "surface.restitution", "[0, 1]"},
        Rejection{"surface.restitution=-0.01", "surface.restitution", "[0, 1]"},
        Rejection{"surface.restitution=inf", "surface.restitution", "[0, 1]"},
        Rejection{"surface.rolling_resistance=-0.01", "surface.rolling_resistance", ">= 0"},
        Rejection{"surface.rolling_resistance=nan", "surface.rolling_resistance", ">= 0"},
        Rejection{"surface.rolling_resistance=\"low\"", "surface.rolling_resistance", ">= 0"},
        Rejection{"surface.spin_friction=-1e-6", "surface.spin_friction", ">= 0"},
        Rejection{"surface.spin_friction=inf", "surface.spin_friction", ">= 0"},
        Rejection{"surface.creep=-1", "surface.creep", ">= 0"}, Rejection{"surface.creep=nan", "surface.creep", ">= 0"},
        Rejection{"surface.slope=0.1", "surface.slope", "a table"},
        Rejection{"surface.slope.angle=-0.1", "surface.slope.angle", ">= 0 and < 1.57"},
        Rejection{"surface.slope.angle=1.6", "surface.slope.angle", ">= 0 and < 1.57"},
        Rejection{"surface.slope.angle=nan", "surface.slope.angle", ">= 0 and < 1.57"},
        Rejection{"surface.slope.downhill=nan", "surface.slope.downhill", "finite"},
        Rejection{"surface.slope.downhil=1", "surface.slope.downhil", "did you mean downhill?"},
        Rejection{"surface.roling_resistance=1", "surface.roling_resistance", "did you mean rolling_resistance?"}));

INSTANTIATE_TEST_SUITE_P(
    InitialRunEnvelope, Rejects,
    ::testing::Values(Rejection{"initial.orientation=[1,0,0]", "initial.orientation", "array of 4"},
                      Rejection{"initial.orientation=[1,0,0,0.01]", "initial.orientation", "within 1e-6"},
                      Rejection{"initial.orientation=[0,0,0,0]", "initial.orientation", "within 1e-6"},
                      Rejection{"initial.orientation=[nan,0,0,0]", "initial.orientation.0", "finite"},
                      Rejection{"initial.angular_velocity=[0,0]", "initial.angular_velocity", "array of 3"},
                      Rejection{"initial.position=[0,0,0]", "initial.position", "array of 2"},
                      Rejection{"initial.height=-1", "initial.height", ">= 0"},
                      Rejection{"run.actuation=manual", "run.actuation", "\"prescribed\", \"stepper\" or \"ideal\""},
                      Rejection{"run.actuation=1", "run.actuation", "\"prescribed\", \"stepper\" or \"ideal\""},
                      Rejection{"run.on_violation=go", "run.on_violation", "\"stop\" or \"continue\""},
                      Rejection{"run.control_period=9e-7", "run.control_period", "[1e-06, 10]"},
                      Rejection{"run.control_period=4.5", "run.control_period", "<= duration = 4"},
                      Rejection{"run.hold=-0.001", "run.hold", "[0, 1000]"},
                      Rejection{"run.hold=1001", "run.hold", "[0, 1000]"},
                      Rejection{"run.hold=nan", "run.hold", "finite"}, Rejection{"run.hold=inf", "run.hold", "finite"},
                      Rejection{"run.hold=long", "run.hold", "number"},
                      Rejection{"run.hold=0.0031", "run.hold", "no whole number of control periods"},
                      Rejection{"run.timer_frequency=9.9e5", "run.timer_frequency", "[1e+06, 1e+08]"},
                      Rejection{"run.timer_frequency=1.1e8", "run.timer_frequency", "[1e+06, 1e+08]"},
                      Rejection{"control.tracking=1", "control.tracking", "true or false"},
                      Rejection{"control.tracking=yes", "control.tracking", "true or false"},
                      Rejection{"control.traking=true", "control.traking", "did you mean tracking?"},
                      Rejection{"control.governor=1", "control.governor", "true or false"},
                      Rejection{"control.friction_use=0", "control.friction_use", "(0, 1]"},
                      Rejection{"control.friction_use=1.01", "control.friction_use", "(0, 1]"},
                      Rejection{"control.friction_use=nan", "control.friction_use", "(0, 1]"},
                      Rejection{"control.belief_error=0.1", "control.belief_error", "a table"},
                      Rejection{"control.belief_error.mass=-0.01", "control.belief_error.mass", "[0, 0.5]"},
                      Rejection{"control.belief_error.mass=0.6", "control.belief_error.mass", "[0, 0.5]"},
                      Rejection{"control.belief_error.mass=nan", "control.belief_error.mass", "[0, 0.5]"},
                      Rejection{"control.belief_error.center_of_mass=-1", "control.belief_error.center_of_mass",
                                ">= 0"},
                      Rejection{"control.belief_error.masses=0", "control.belief_error.masses", "did you mean mass?"},
                      Rejection{"control=true", "control", "a table"},
                      Rejection{"envelope.min_normal_force=-1", "envelope.min_normal_force", ">= 0"},
                      Rejection{"envelope.friction_use=0", "envelope.friction_use", "(0, 1]"},
                      Rejection{"envelope.friction_use=1.01", "envelope.friction_use", "(0, 1]"}));

INSTANTIATE_TEST_SUITE_P(
    Mass, Rejects,
    ::testing::Values(
        Rejection{"mass.0.mass=0", "mass.0.mass", "> 0"}, Rejection{"mass.0.rail=1", "mass.0.rail", "a table"},
        Rejection{"mass.0.rail.shape=square", "mass.0.rail.shape", "\"circle\", \"line\" or \"spline\""},
        Rejection{"mass.0.rail.radius=0", "mass.0.rail.radius", "> 0"},
        Rejection{"mass.0.rail.radius=2.0001", "mass.0.rail.radius", "ball.radius = 2"},
        Rejection{"mass.0.rail.direction=5", "mass.0.rail.direction", "a table"},
        Rejection{"mass.0.rail.direction.azimuth=inf", "mass.0.rail.direction.azimuth", "finite"},
        Rejection{"mass.0.rail.center=[0,0,0]", "mass.0.rail.center", "direction = { azimuth, elevation }, or axes"},
        Rejection{"mass.2.rail.center=[0,0]", "mass.2.rail.center", "array of 3"},
        Rejection{"mass.2.rail.axes=[[1,0,0]]", "mass.2.rail.axes", "2 vectors"},
        Rejection{"mass.2.rail.axes=[[1,0,0],5]", "mass.2.rail.axes.1", "array of 3"},
        Rejection{"mass.2.rail.axes=[[1,0,0],[0,1]]", "mass.2.rail.axes.1", "array of 3"},
        Rejection{"mass.2.rail.axes=[[1,0,0],[0,1,nan]]", "mass.2.rail.axes.1.2", "finite"},
        Rejection{"mass.2.rail.axes=[[1,0,0],[0,1.00001,0]]", "mass.2.rail.axes", "within 1e-6"},
        Rejection{"mass.2.rail.axes=[[1,0,0],[0.00001,1,0]]", "mass.2.rail.axes", "within 1e-6"},
        Rejection{"mass.1.rail.direction=[0,0,0]", "mass.1.rail.direction", "not zero"},
        Rejection{"mass.1.rail.origin=[0,0,nan]", "mass.1.rail.origin.2", "finite"},
        Rejection{"mass.0.initial_position=nan", "mass.0.initial_position", "finite"},
        Rejection{"mass.0.initial_velocity=inf", "mass.0.initial_velocity", "finite"},
        Rejection{"mass.0.motion=5", "mass.0.motion", "array of at most 128"},
        Rejection{"mass.0.motion=[5]", "mass.0.motion.0", "a table"},
        Rejection{"mass.0.motion.1.duration=0", "mass.0.motion.1.duration", "> 0"},
        Rejection{"mass.0.motion.1.duration=inf", "mass.0.motion.1.duration", "finite"},
        Rejection{"mass.0.motion.1.acceleration=[1]", "mass.0.motion.1.acceleration", "array of 2"},
        Rejection{"mass.0.motion.1.acceleration=[1,2,3]", "mass.0.motion.1.acceleration", "array of 2"},
        Rejection{"mass.0.motion.1.acceleration=[1,nan]", "mass.0.motion.1.acceleration.1", "finite"},
        Rejection{"mass.0.motion.1={duration=1e-3,acceleration=[-1e14,1e14]}", "mass.0.motion.1.acceleration",
                  "/ duration of at most 1e+15"},
        Rejection{"mass.0.motion=[{duration=1e8,acceleration=[1e8,1e8]}]", "mass.0.motion", "at most 1e+15"}));

// Every key that takes a number of any size, with one that no robot has.
TEST(Scenario, NumbersOfSensibleSizesOnly) {
  const std::vector<std::string> positive = {"duration",
                                             "ball.radius",
                                             "ball.mass",
                                             "ball.inertia.0",
                                             "surface.static_friction",
                                             "surface.kinetic_friction",
                                             "mass.0.mass",
                                             "mass.0.rail.radius",
                                             "mass.0.motion.0.duration",
                                             "mass.1.rail.end_stop_stiffness",
                                             "mass.0.motor.gear_ratio",
                                             "mass.1.motor.travel_per_revolution",
                                             "mass.0.motor.holding_torque",
                                             "mass.0.motor.rotor_inertia",
                                             "mass.0.motor.corner_speed",
                                             "mass.0.motor.max_step_rate",
                                             "mass.0.motor.max_acceleration",
                                             "mass.0.motor.max_jerk"};
  const std::vector<std::string> any = {"gravity",
                                        "external_force.0",
                                        "drag.coefficient",
                                        "drag.wind.0",
                                        "ball.center_of_mass.0",
                                        "mass.0.rail.direction.azimuth",
                                        "mass.0.rail.direction.elevation",
                                        "mass.2.rail.center.0",
                                        "mass.1.rail.origin.0",
                                        "mass.1.rail.direction.0",
                                        "mass.1.rail.end_stops.1",
                                        "mass.0.initial_position",
                                        "mass.0.initial_velocity",
                                        "mass.0.motion.0.acceleration.0",
                                        "mass.0.motor.viscous_damping",
                                        "initial.angular_velocity.0",
                                        "initial.position.0",
                                        "initial.height",
                                        "envelope.min_normal_force",
                                        "published.0.value"};
  const std::string text = kFull + "[drag]\ncoefficient = 1\nwind = [0, 0, 0]\n";
  const auto expect_refused = [&](const std::string& key, const std::string& value) {
    bool said = false;
    for (const ScenarioError& error : parse(text, {key + "=" + value}).errors) {
      said = said || (error.key == key && error.value == value && contains(error.message, "1e-15 to 1e+15 in size"));
    }
    EXPECT_TRUE(said) << key << " = " << value;
  };
  for (const std::string& key : positive) {
    for (const char* value : {"1e300", "1.1e15", "9e-16", "1e-300"}) expect_refused(key, value);
  }
  for (const std::string& key : any) {
    for (const char* value : {"1e300", "1.1e15"}) expect_refused(key, value);
  }
  EXPECT_EQ(accepted(text, {"envelope.min_normal_force=1e-300"}).envelope.min_normal_force_n,
            1e-300);  // as good as none
  // The ball in um, its mass in t: units as odd as any.
  EXPECT_EQ(accepted(R"(duration = 1
gravity = 9.81e6
[ball]
radius = 1e5
mass = 1e-3
inertia = [4e6, 4e6, 4e6]
[[mass]]
mass = 1e-4
rail = { shape = "circle", radius = 8e4, direction = { azimuth = 0, elevation = 0 } }
)")
                .gravity_mps2,
            9.81e6);
}

INSTANTIATE_TEST_SUITE_P(
    Motor, Rejects,
    ::testing::Values(
        Rejection{"mass.0.motor=1", "mass.0.motor", "a table"},
        Rejection{"mass.0.motor.steps_per_revolution=0", "mass.0.motor.steps_per_revolution", "[4, 2000]"},
        Rejection{"mass.0.motor.steps_per_revolution=2004", "mass.0.motor.steps_per_revolution", "[4, 2000]"},
        Rejection{"mass.0.motor.steps_per_revolution=202", "mass.0.motor.steps_per_revolution", "multiple of 4"},
        Rejection{"mass.0.motor.steps_per_revolution=200.0", "mass.0.motor.steps_per_revolution", "a float"},
        Rejection{"mass.0.motor.microsteps=0", "mass.0.motor.microsteps", "[1, 256]"},
        Rejection{"mass.0.motor.microsteps=257", "mass.0.motor.microsteps", "[1, 256]"},
        Rejection{"mass.0.motor.gear_ratio=0", "mass.0.motor.gear_ratio", "> 0"},
        Rejection{"mass.0.motor.gear_ratio=-1", "mass.0.motor.gear_ratio", "> 0"},
        Rejection{"mass.1.motor.gear_ratio=1", "mass.1.motor.gear_ratio", "travel_per_revolution"},
        Rejection{"mass.0.motor.travel_per_revolution=1", "mass.0.motor.travel_per_revolution", "gear_ratio"},
        Rejection{"mass.1.motor.travel_per_revolution=0", "mass.1.motor.travel_per_revolution", "> 0"},
        Rejection{"mass.0.motor.holding_torque=0", "mass.0.motor.holding_torque", "> 0"},
        Rejection{"mass.0.motor.detent_torque=-1", "mass.0.motor.detent_torque", ">= 0 and < 15,"},
        Rejection{"mass.0.motor.detent_torque=15", "mass.0.motor.detent_torque", ">= 0 and < 15,"},
        Rejection{"mass.0.motor.rotor_inertia=0", "mass.0.motor.rotor_inertia", "> 0"},
        Rejection{"mass.0.motor.viscous_damping=-1", "mass.0.motor.viscous_damping", ">= 0"},
        Rejection{"mass.0.motor.corner_speed=0", "mass.0.motor.corner_speed", "> 0"},
        Rejection{"mass.0.motor.preset=nema99", "mass.0.motor.preset", "\"nema11\", \"nema17\" or \"nema23\""},
        Rejection{"mass.0.motor.preset=17", "mass.0.motor.preset", "\"nema17\""},
        Rejection{"mass.0.motor.step_error=0.11", "mass.0.motor.step_error", "[0, 0.1]"},
        Rejection{"mass.0.motor.step_error=-0.01", "mass.0.motor.step_error", "[0, 0.1]"},
        Rejection{"mass.0.motor.max_step_rate=0", "mass.0.motor.max_step_rate", "> 0"},
        Rejection{"mass.0.motor.max_step_rate=inf", "mass.0.motor.max_step_rate", "> 0"},
        Rejection{"mass.0.motor.max_acceleration=0", "mass.0.motor.max_acceleration", "> 0"},
        Rejection{"mass.0.motor.max_jerk=0", "mass.0.motor.max_jerk", "> 0"},
        Rejection{"mass.0.motor.max_jerk=nan", "mass.0.motor.max_jerk", "> 0"}));

INSTANTIATE_TEST_SUITE_P(Published, Rejects,
                         ::testing::Values(Rejection{"published=1", "published", "[[published]]"},
                                           Rejection{"published.0.quantity=speed", "published.0.quantity",
                                                     "\"mu_required.max\", \"normal_force.min\" or"},
                                           Rejection{"published.0.value=nan", "published.0.value", "finite"},
                                           Rejection{"published.0.source=\"\"", "published.0.source", "not empty"},
                                           Rejection{"published.0.source=5", "published.0.source", "not empty"}));

TEST(Scenario, RejectsALongName) {
  const auto named = [](int length) { return "name=" + std::string(static_cast<std::size_t>(length), 'n'); };
  EXPECT_EQ(accepted(kFull, {named(64)}).name.size(), 64u);
  EXPECT_EQ(only_error(kFull, {named(65)}).key, "name");
}

TEST(Scenario, IsNamedAfterItsFileAsNearAsAFolderMayBe) {
  for (const auto& [file, name] :
       std::vector<std::pair<std::string, std::string>>{{"dir/robot-1.toml", "robot-1"},
                                                        {"my ball.toml", "my_ball"},
                                                        {"a\nb$c.toml", "a_b_c"},
                                                        {"\xC3\xA9.toml", "__"},  // one letter of two bytes
                                                        {"..x.y.toml", "__x.y"},
                                                        {"dir/", "scenario"},
                                                        {"", "scenario"},
                                                        {std::string(70, 'n') + ".toml", std::string(64, 'n')}}) {
    const ScenarioResult result = parse_scenario(kMinimal, file);
    EXPECT_TRUE(result.ok()) << file << '\n' << all_errors(result);
    EXPECT_EQ(result.scenario.name, name) << file;
  }
}

TEST(Scenario, NamesTheBallRadiusWhereverItIsFaulty) {
  for (const char* value : {"0", "-1", "nan", "inf", "true"}) {
    // Nothing else can be said of rails and centre of mass then, and nothing else is.
    EXPECT_EQ(only_error(kFull, {std::string("ball.radius=") + value}).key, "ball.radius") << value;
  }
}

TEST(Scenario, RejectsControlPeriodsOutsideTheClocks) {
  // One key too coarse for the duration or too fine for the timer; each is said of the key that is given.
  EXPECT_EQ(only_error(kMinimal, {"duration=100", "run.control_period=10.5"}).key, "run.control_period");
  EXPECT_TRUE(accepted(kMinimal, {"duration=100", "run.control_period=10"}).id != 0);
  // A run too short for the default period is the duration's fault.
  const ScenarioError no_tick = only_error(kMinimal, {"duration=1e-4"});
  EXPECT_EQ(no_tick.key, "duration");
  EXPECT_TRUE(contains(no_tick.message, "allowed: >= run.control_period = 0.001 s, its default")) << no_tick.message;
  const ScenarioError half_a_tick = only_error(kMinimal, {"duration=1", "run.control_period=2"});
  EXPECT_EQ(half_a_tick.key, "run.control_period");
  EXPECT_EQ(half_a_tick.message, "is longer than the run; allowed: <= duration = 1 s");
  const ScenarioError coarse = only_error(kMinimal, {"duration=2e6", "run.control_period=0.001"});
  EXPECT_EQ(coarse.key, "run.control_period");
  EXPECT_TRUE(contains(coarse.message, "2e+09 control periods"));
  EXPECT_EQ(only_error(kMinimal, {"duration=1.001e6", "run.control_period=0.001"}).key, "run.control_period");
  EXPECT_EQ(accepted(kMinimal, {"duration=1e6", "run.control_period=0.001"}).duration_s, 1e6);
  EXPECT_TRUE(
      contains(only_error(kMinimal, {"run.control_period=1e-6", "run.timer_frequency=9.9e6"}).message, "10 to 1e9"));
  EXPECT_EQ(accepted(kMinimal, {"run.control_period=1e-6", "run.timer_frequency=1.1e7"}).run.control_period_s, 1e-6);
  // The most timer ticks there can be, which a 32-bit count of them holds twice over.
  EXPECT_EQ(
      accepted(kMinimal, {"duration=10", "run.control_period=10", "run.timer_frequency=1e8"}).run.timer_frequency_hz,
      1e8);
}

TEST(Scenario, InertiaOfAPlateIsAllowed) {
  EXPECT_EQ(accepted(kFull, {"ball.inertia=[1, 1, 2]"}).ball.inertia_kgm2[2], 2);
  EXPECT_EQ(accepted(kFull, {"ball.inertia=[0.1, 0.2, 0.3]"}).ball.inertia_kgm2[2], 0.3);  // 0.1 + 0.2 rounds up
}

TEST(Scenario, ReportsEveryMissingRequiredKeyWithItsTable) {
  const ScenarioResult empty = parse("");
  std::vector<std::string> keys;
  for (const ScenarioError& error : empty.errors) {
    keys.push_back(error.key);
    EXPECT_TRUE(contains(error.message, "is missing"));
    EXPECT_EQ(error.source, "test.toml");
    EXPECT_TRUE(error.value.empty());
  }
  EXPECT_EQ(keys, (std::vector<std::string>{"duration", "gravity", "ball.radius", "ball.mass", "ball.inertia"}));

  const std::string no_mass = replaced(kMinimal, "mass = 3.0\n", "");
  const ScenarioError error = only_error(no_mass);
  EXPECT_EQ(error.key, "ball.mass");
  EXPECT_EQ(error.line, line_of(no_mass, "[ball]"));
  EXPECT_TRUE(contains(error.message, "missing from [ball]; allowed: a finite number > 0"));
}

TEST(Scenario, ReportsMissingKeysOfAMass) {
  const std::string text = kMinimal + "[[mass]]\nrail = { shape = \"line\", direction = [1, 0, 0] }\n" +
                           "motion = [ { acceleration = [1, 1] } ]\n[[mass]]\nmass = 1\n" +
                           "[[mass]]\nmass = 1\nrail = { shape = \"circle\", radius = 1 }\n" +
                           "[[mass]]\nmass = 1\nrail = { shape = \"circle\", radius = 1, center = [0, 0, 0] }\n";
  const ScenarioResult result = parse(text);
  std::vector<std::string> found;
  for (const ScenarioError& error : result.errors) found.push_back(error.key + " " + std::to_string(error.line));
  EXPECT_EQ(found,
            (std::vector<std::string>{"mass.0.mass 7", "mass.0.rail.origin 8", "mass.0.motion.0.duration 9",
                                      "mass.1.rail.shape 10", "mass.2.rail.direction 14", "mass.3.rail.axes 17"}))
      << all_errors(result);
}

TEST(Scenario, SaysLineKeyValueInTheFilesOrder) {
  std::string text = replaced(kFull, "gravity = 9.0", "gravity = -9.0");
  text = replaced(text, "restitution = 0.1", "restitution = 2");
  text = replaced(text, "acceleration = [2.0, -3.0]", "acceleration = [2.0, -3.0, 1]");
  text = replaced(text, "friction_use = 0.9", "friction_use = \"all\"");
  const ScenarioResult result = parse(text);
  ASSERT_EQ(result.errors.size(), 4u) << all_errors(result);
  const auto check = [&](std::size_t i, const char* key, const char* value, const char* written) {
    EXPECT_EQ(result.errors[i].source, "test.toml");
    EXPECT_EQ(result.errors[i].key, key);
    EXPECT_EQ(result.errors[i].value, value);
    EXPECT_EQ(result.errors[i].line, line_of(text, written));
  };
  check(0, "gravity", "-9.0", "gravity");
  check(1, "surface.restitution", "2", "restitution");
  check(2, "mass.0.motion.1.acceleration", "[2.0, -3.0, 1]", "[2.0, -3.0, 1]");
  check(3, "envelope.friction_use", "\"all\"", "friction_use");
  EXPECT_EQ(to_string(result.errors[0]),
            "test.toml:3: gravity = -9.0: is out of range; allowed: a finite number >= 0, in m/s^2");
}

TEST(Scenario, ErrorTextLeavesOutWhatIsNotKnown) {
  EXPECT_EQ(to_string({"a.toml", 0, "ball.mass", "", "is missing"}), "a.toml: ball.mass: is missing");
  EXPECT_EQ(to_string({"a.toml", 4, "", "", "not TOML"}), "a.toml:4: not TOML");
  EXPECT_EQ(to_string({"--set", 0, "", "foo", "has no '='"}), "--set: foo: has no '='");
}

TEST(Scenario, QuotesAValueAsWritten) {
  EXPECT_EQ(only_error(replaced(kMinimal, "gravity = 1.0", "gravity =  -1_0.50e-1  # comment")).value, "-1_0.50e-1");
  // Columns are counted in characters, not bytes.
  const ScenarioError error =
      only_error("surface = { static_friction = 1, restitution = \"\u00e9\u00e9\" }\n" + kMinimal);
  EXPECT_EQ(error.key, "surface.restitution");
  EXPECT_EQ(error.value, "\"\u00e9\u00e9\"");
}

TEST(Scenario, StopsAtATomlSyntaxErrorWithItsLine) {
  for (const auto& [text, line] : std::vector<std::pair<std::string, int>>{{"duration = 1\ngravity = \n", 2},
                                                                           {"a = 1\na = 2\n", 2},
                                                                           {"[ball\n", 1},
                                                                           {"x = 1\ny = = 2\n", 2},
                                                                           {"\xff", 1}}) {
    const ScenarioResult result = parse(text);
    ASSERT_EQ(result.errors.size(), 1u) << text << all_errors(result);
    EXPECT_EQ(result.errors[0].line, line) << text;
    EXPECT_TRUE(contains(result.errors[0].message, "not TOML"));
  }
}

// Each is within what toml++ bounds; together they end the stack of whoever follows them down.
TEST(Scenario, AValueInThousandsOfOthersIsRefusedByItsLine) {
  const auto nested = [](int levels, const std::string& key) {
    std::string text = "1";
    for (int i = 0; i < levels; ++i) text = std::string("{ ").append(key).append(" = ").append(text).append(" }");
    return text;
  };
  for (const std::string& value : {nested(200, "a.a.a.a.a.a.a.a.a.a.a.a.a.a.a.a"), nested(16, "a")}) {
    const ScenarioResult result = parse("duration = 1\nx = " + value + "\n");
    ASSERT_EQ(result.errors.size(), 1u) << all_errors(result);
    EXPECT_EQ(result.errors[0].line, 2);
    EXPECT_TRUE(contains(result.errors[0].message, "has a value nested deeper than 16")) << result.errors[0].message;
    EXPECT_EQ(only_error(kMinimal, {"x=" + value}).key, "x");
  }
  // One less is read: it is the key that is wrong.
  EXPECT_EQ(only_error("x = " + nested(15, "a") + "\n" + kMinimal).key, "x");
}

TEST(Scenario, NamesAKeyGivenTwice) {
  const std::string long_key(60, 'k');
  for (const auto& [text, key] : std::vector<std::pair<std::string, std::string>>{
           {"[ball]\nradius = 1\nradius = 2\n", "'radius'"},
           {"[surface]\n[surface]\n", "'surface'"},
           {long_key + " = 1\n" + long_key + " = 2\n", "'" + long_key + "'"}}) {
    EXPECT_TRUE(contains(only_error(text).message, key));
  }
}

TEST(Scenario, UnknownKeysSuggestTheNearestOfTheirLevel) {
  struct Case {
    const char* assignment;
    const char* key;
    const char* suggestion;
  };
  for (const Case& c : std::vector<Case>{
           {"gravty=1", "gravty", "did you mean gravity?"},
           {"masses=1", "masses", "did you mean mass?"},
           {"amss=1", "amss", "did you mean mass?"},
           {"Surface.restitution=1", "Surface", "did you mean surface?"},
           {"ball.raduis=1", "ball.raduis", "did you mean radius?"},
           {"surface.static_frictoin=1", "surface.static_frictoin", "did you mean static_friction?"},
           {"surface.kinetic=1", "surface.kinetic",
            "allowed in [surface]: static_friction, kinetic_friction, restitution, rolling_resistance, spin_friction, "
            "creep, slope"},
           {"initial.angular_velocty=1", "initial.angular_velocty", "did you mean angular_velocity?"},
           {"run.control_periods=1", "run.control_periods", "did you mean control_period?"},
           {"envelope.friction_used=1", "envelope.friction_used", "did you mean friction_use?"},
           {"mass.0.inital_position=1", "mass.0.inital_position", "did you mean initial_position?"},
           {"mass.0.rail.raduis=1", "mass.0.rail.raduis", "did you mean radius?"},
           {"mass.0.rail.direction.azimut=1", "mass.0.rail.direction.azimut", "did you mean azimuth?"},
           {"mass.1.rail.radius=1", "mass.1.rail.radius", "allowed in rail of [[mass]] 1: shape, origin, direction"},
           {"mass.0.motion.0.accelaration=1", "mass.0.motion.0.accelaration", "did you mean acceleration?"},
           {"mass.0.motor.microstep=1", "mass.0.motor.microstep", "did you mean microsteps?"}}) {
    const ScenarioError error = only_error(kFull, {c.assignment});
    EXPECT_EQ(error.key, c.key);
    EXPECT_TRUE(contains(error.message, "unknown key")) << c.assignment;
    EXPECT_TRUE(contains(error.message, c.suggestion)) << c.assignment;
  }
  // Far from everything: no suggestion, but the list.
  for (const char* far : {"zzz=1", "ball.zzz=1", "ball.rad=1"}) {
    const ScenarioError error = only_error(kFull, {far});
    EXPECT_EQ(error.message.find("did you mean"), std::string::npos) << error.message;
    EXPECT_TRUE(contains(error.message, "allowed in"));
  }
}

TEST(Scenario, AWrongChoiceSuggestsTheNearest) {
  EXPECT_EQ(only_error(kFull, {"run.actuation=steper"}).message,
            "is none of the choices; did you mean stepper?; allowed: \"prescribed\", \"stepper\" or \"ideal\"");
  EXPECT_EQ(only_error(kFull, {"mass.0.motor.preset=nema71"}).message,
            "is none of the choices; did you mean nema11?; allowed: \"nema11\", \"nema17\" or \"nema23\"");
  EXPECT_EQ(only_error(kFull, {"run.actuation=zzz"}).message,
            "is none of the choices; allowed: \"prescribed\", \"stepper\" or \"ideal\"");
}

TEST(Scenario, MissingKeysNameTheirTableAsItIsWritten) {
  const ScenarioError error = only_error(kFull + "[[fault]]\nkind = \"motor_stall\"\n");
  EXPECT_TRUE(contains(error.message, "is missing from [[fault]] 0; allowed: ")) << error.message;
}

TEST(Scenario, OrientationIsNormalisedOnlyIfNearlyUnit) {
  const Scenario s = accepted(kFull, {"initial.orientation=[0.6000004, 0.8000004, 0, 0]"});
  // One rounding each of norm and quotients.
  EXPECT_NEAR(s.initial.orientation.norm(), 1, 4e-16);
  EXPECT_NEAR(s.initial.orientation.x() / s.initial.orientation.w(), 0.8000004 / 0.6000004, 1e-15);
  EXPECT_EQ(only_error(kFull, {"initial.orientation=[0.600002, 0.800002, 0, 0]"}).key, "initial.orientation");
}

TEST(Scenario, TheRollingVelocityIsNoVelocityOfItsOwn) {
  EXPECT_FALSE(accepted(kMinimal, {"initial.velocity=[0,0,0]"}).initial.has_velocity);
  // Omega = (0.1, 0.2, 0.3), a quarter turn about e1 (y -> z, z -> -y): omega = (0.1, -0.3, 0.2); radius 2:
  // omega x 2 e3 = 2 (omega_2, -omega_1, 0) = (-0.6, -0.2, 0).
  const std::vector<std::string> turned = {"initial.orientation=[0.70710678118654752, 0.70710678118654752, 0, 0]",
                                           "initial.velocity=[-0.6, -0.2, 0.0]"};
  EXPECT_FALSE(accepted(kFull, turned).initial.has_velocity);
  for (const char* other : {"initial.velocity=[-0.6, -0.2, 1e-8]", "initial.velocity=[-0.60000001, -0.2, 0]",
                            "initial.velocity=[0.6, 0.2, 0]", "initial.velocity=[0, 0, 0]"}) {
    EXPECT_TRUE(accepted(kFull, {turned[0], other}).initial.has_velocity);
  }
}

TEST(Scenario, AStartInSlidingNeedsAFiniteFriction) {
  const std::string sliding = "initial.velocity=[1, 0, 0]";
  const ScenarioError error = only_error(kMinimal, {sliding});
  EXPECT_EQ(error.key, "initial.velocity");
  EXPECT_TRUE(contains(error.message, "finite surface.kinetic_friction"));
  EXPECT_TRUE(accepted(kMinimal, {sliding, "surface.kinetic_friction=0.3"}).initial.has_velocity);
  // In the air, arriving or leaving there is no friction yet.
  EXPECT_EQ(accepted(kMinimal, {sliding, "initial.height=0.5"}).initial.height_m, 0.5);
  EXPECT_EQ(accepted(kMinimal, {"initial.velocity=[1, 0, -1]"}).initial.velocity_W_mps[2], -1);
  EXPECT_EQ(accepted(kMinimal, {"run.on_violation=continue"}).run.on_violation, OnViolation::kContinue);
}

TEST(Scenario, AtMostEightMassesAndAsManyPiecesAsTheFirmwareHolds) {
  std::string eight = kMinimal;
  const std::string one =
      "[[mass]]\nmass = 1\nrail = { shape = \"line\", origin = [0, 0, 0], direction = [1, 0, 0] }\n";
  for (int i = 0; i < 8; ++i) eight += one;
  EXPECT_EQ(accepted(eight).masses.size(), 8u);
  const ScenarioError error = only_error(eight + one);
  EXPECT_EQ(error.key, "mass");
  EXPECT_TRUE(contains(error.message, "has 9 entries; allowed: an array of at most 8"));

  const auto pieces = [&](int count) {
    std::string text = kMinimal + one + "motion = [";
    for (int i = 0; i < count; ++i) text += "{ duration = 0.1, acceleration = [0, 0] },";
    return text + "]\n";
  };
  EXPECT_EQ(accepted(pieces(kMaxMotionPieces)).masses[0].motion.size(), static_cast<std::size_t>(kMaxMotionPieces));
  EXPECT_EQ(only_error(pieces(kMaxMotionPieces + 1)).key, "mass.0.motion");
}

}  // namespace
}  // namespace ballast::sim
