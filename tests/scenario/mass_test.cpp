// Rails, how far masses may go, motor defaults and step rates.
#include <cmath>
#include <numbers>

#include "sim/masses/motion_extent.h"
#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

using std::numbers::pi;

std::string on_line(const std::string& rest, const std::string& origin = "[0, 0, 0]") {
  return kMinimal + "[[mass]]\nmass = 0.5\nrail = { shape = \"line\", origin = " + origin +
         ", direction = [1, 0, 0] }\n" + rest;
}

TEST(Rails, CircleByDirectionIsThePapersCircle) {
  // n = e3 for elevation pi/2: Frisvad's b1 = (1,0,0), b2 = (0,1,0), so zeta = r (n cos - b1 sin).
  const Scenario s = accepted(kFull, {"mass.0.rail.direction={azimuth=0, elevation=1.5707963267948966}"});
  const auto at = [&](double theta) { return firmware::evaluate(s.masses[0].rail, theta).position; };
  EXPECT_LT((at(0) - Eigen::Vector3d(0, 0, 1.5)).norm(), 1e-15);  // cos(pi/2) is 6e-17
  EXPECT_LT((at(pi / 2) - Eigen::Vector3d(-1.5, 0, 0)).norm(), 1e-15);
}

TEST(Rails, CircleByAxesIsCenterPlusRadiusCosSin) {
  const Scenario s = accepted(kFull);
  const firmware::Rail& rail = s.masses[2].rail;
  EXPECT_EQ(rail.axis_cos_B, Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(rail.axis_sin_B, Eigen::Vector3d(0, 0, 1));
  EXPECT_LT((firmware::evaluate(rail, pi / 2).position - Eigen::Vector3d(0, 0, 0.4)).norm(), 1e-16);
}

TEST(Rails, AxesWithinToleranceAreMadeOrthonormal) {
  const Scenario s = accepted(kFull, {"mass.2.rail.axes=[[1, 8e-7, 0], [3e-8, 0, 0.9999993]]"});
  const firmware::Rail& rail = s.masses[2].rail;
  // A few roundings of a Gram-Schmidt step of nearly orthonormal vectors.
  EXPECT_NEAR(rail.axis_cos_B.norm(), 1, 4e-16);
  EXPECT_NEAR(rail.axis_sin_B.norm(), 1, 4e-16);
  EXPECT_NEAR(rail.axis_cos_B.dot(rail.axis_sin_B), 0, 4e-16);
}

TEST(Rails, LineDirectionIsNormalised) {
  const Scenario s = accepted(kFull, {"mass.1.rail.direction=[0, 3e-200, 4e-200]"});
  EXPECT_LT((s.masses[1].rail.axis_cos_B - Eigen::Vector3d(0, 0.6, 0.8)).norm(), 4e-16);
}

TEST(Rails, AWholeCircleHasToFitIntoTheBall) {
  // Centre (0.3, 0.4, 0.5), plane normal e3, radius 1: farthest point at hypot(1 + 0.5, 0.5).
  const auto text = [](const char* radius) {
    return kMinimal + "[[mass]]\nmass = 1\nrail = { shape = \"circle\", radius = " + radius +
           ", center = [0.3, 0.4, 0.5], axes = [[1, 0, 0], [0, 1, 0]] }\n";
  };
  const std::string reach = "ball.radius=1.5811388300841898";  // sqrt(2.5), rounded up
  EXPECT_EQ(accepted(text("1"), {reach}).masses.size(), 1u);
  const ScenarioError error = only_error(text("1.000001"), {reach});
  EXPECT_EQ(error.key, "mass.0.rail.radius");
  EXPECT_TRUE(contains(error.message, "1.58113977"));                               // hypot(1.500001, 0.5)
  EXPECT_EQ(accepted(kFull, {"mass.0.rail.radius=2"}).masses[0].rail.radius_m, 2);  // on the ball's surface
}

TEST(MotionExtent, TurningPointOfConstantAcceleration) {
  // theta = 2 t - t^2 / 2: greatest at t = 2, where it is 2; then down to 2 * 6 - 18 = -6 at t = 6.
  Mass mass;
  mass.initial_velocity = 2;
  mass.motion = {{6, -1, -1}};
  const PositionExtent extent = position_extent(mass, 6);
  EXPECT_DOUBLE_EQ(extent.greatest.position, 2);
  EXPECT_DOUBLE_EQ(extent.greatest.time_s, 2);
  EXPECT_DOUBLE_EQ(extent.least.position, -6);
  EXPECT_DOUBLE_EQ(extent.least.time_s, 6);
  EXPECT_DOUBLE_EQ(position_extent(mass, 3).least.position, 0);  // not there yet
  EXPECT_DOUBLE_EQ(speed_extent(mass).greatest_speed, 4);
  EXPECT_EQ(speed_extent(mass).greatest_acceleration, 1);
}

TEST(MotionExtent, BothTurningPointsInsideOnePiece) {
  // theta' = 2 - 6 t + 3 t^2, theta = 2 t - 3 t^2 + t^3: extremes at 1 -+ 1/sqrt 3, of +-2/(3 sqrt 3); 0 at t = 0,
  // 1, 2.
  Mass mass;
  mass.initial_velocity = 2;
  mass.motion = {{2, -6, 6}};
  const PositionExtent extent = position_extent(mass, 2);
  // Roots and a cubic of numbers near 1: a few ulps.
  EXPECT_NEAR(extent.greatest.position, 2 / (3 * std::sqrt(3.0)), 1e-15);
  EXPECT_NEAR(extent.greatest.time_s, 1 - 1 / std::sqrt(3.0), 1e-15);
  EXPECT_NEAR(extent.least.position, -2 / (3 * std::sqrt(3.0)), 1e-15);
  EXPECT_NEAR(extent.least.time_s, 1 + 1 / std::sqrt(3.0), 1e-15);
}

TEST(MotionExtent, FastestInsideAPieceWhereTheAccelerationChangesSign) {
  // theta'' = 1 - t from rest: theta' = t - t^2/2, greatest 0.5 at t = 1, back to 0 at t = 2.
  Mass mass;
  mass.motion = {{1, 0, 0}, {2, 1, -1}};
  const SpeedExtent speed = speed_extent(mass);
  EXPECT_DOUBLE_EQ(speed.greatest_speed, 0.5);
  EXPECT_EQ(speed.fastest_piece, 1u);
}

TEST(MotionExtent, ConstantVelocityAfterTheLastPieceCounts) {
  Mass mass;
  mass.motion = {{1, 1, 1}};  // 0.5 m, then 1 m/s
  const PositionExtent extent = position_extent(mass, 4);
  EXPECT_DOUBLE_EQ(extent.greatest.position, 3.5);
  EXPECT_EQ(extent.greatest.piece, 1u);
  EXPECT_DOUBLE_EQ(extent.greatest.time_s, 4);
}

TEST(Lines, AMassHasToStayInTheBallForTheWholeRun) {
  struct Case {
    const char* what;
    std::string rest;
    const char* key;
    const char* message;
  };
  for (const Case& c : std::vector<Case>{
           {"start", "initial_position = -2.5\n", "mass.0.initial_position",
            "2.5 m from the geometric centre at t = 0 s"},
           {"inside a piece",
            "initial_velocity = 3\nmotion = [{ duration = 2.5, acceleration = [-2, -2] },"
            "{ duration = 1, acceleration = [2, 2] }]\n",
            "mass.0.motion.0", "2.25 m from the geometric centre at t = 1.5 s"},
           {"end of a piece",
            "motion = [{ duration = 1, acceleration = [0, 0] }, { duration = 3, acceleration = [-1, -1] }]\n",
            "mass.0.motion.1", "4.5 m from the geometric centre at t = 4 s"},
           // 0.5 m after 1 s, then 1 m/s.
           {"after the pieces", "motion = [{ duration = 1, acceleration = [1, 1] }]\n", "mass.0.motion",
            "continues with 1 m/s after its last piece, motion.0, which ends at t = 1 s, passes the end of its rail at "
            "t = 2.5 s, and takes the mass 3.5 m from the geometric centre at t = 4 s"},
           // 2.5 m after 1 s: beyond the end before the motion is over.
           {"before and after the pieces", "motion = [{ duration = 1, acceleration = [5, 5] }]\n", "mass.0.motion",
            "ends at t = 1 s with the mass already beyond the end of its rail, and takes the mass 17.5 m"},
           {"initial velocity", "initial_velocity = -1\n", "mass.0.initial_velocity",
            "4 m from the geometric centre at t = 4 s"}}) {
    const ScenarioError error = only_error(on_line(c.rest));
    EXPECT_EQ(error.key, c.key) << c.what;
    EXPECT_TRUE(contains(error.message, c.message)) << c.what;
    EXPECT_TRUE(contains(error.message, "allowed: <= ball.radius = 2")) << c.what;
  }
}

TEST(Lines, TheLimitItselfIsAllowed) {
  EXPECT_EQ(accepted(on_line("initial_velocity = 0.5\n")).masses.size(), 1u);  // 2 m at t = 4 s
  EXPECT_EQ(only_error(on_line("initial_velocity = 0.5000001\n")).key, "mass.0.initial_velocity");
  // Turns at exactly 2 m, at t = 1 s: v = 4, a = -4.
  EXPECT_EQ(accepted(on_line("initial_velocity = 4\nmotion = [{ duration = 2, acceleration = [-4, -4] },"
                             "{ duration = 1, acceleration = [4, 4] }]\n"))
                .masses.size(),
            1u);
  // A shorter run ends before the mass leaves.
  EXPECT_EQ(accepted(on_line("initial_velocity = 1\n"), {"duration=2"}).masses.size(), 1u);
}

TEST(Lines, AnOffsetLineIsAShorterChord) {
  // At height 1.2 in a ball of radius 2 the line reaches 1.6.
  EXPECT_EQ(accepted(on_line("initial_position = -1.6\n", "[0, 0, 1.2]")).masses.size(), 1u);
  EXPECT_EQ(only_error(on_line("initial_position = -1.601\n", "[0, 0, 1.2]")).key, "mass.0.initial_position");
  EXPECT_EQ(only_error(on_line("", "[0, 0, 2.1]")).key, "mass.0.rail");
}

TEST(MotorDefaults, OnACircle) {
  const std::string text = R"(duration = 4.0
gravity = 9.0
[ball]
radius = 2.0
mass = 3.0
inertia = [1.0, 1.1, 1.2]
[[mass]]
mass = 0.5
rail = { shape = "circle", radius = 1.5, direction = { azimuth = 0.3, elevation = 0.4 } }
motion = [ { duration = 1.0, acceleration = [1.0, -4.0] } ]
)";
  const Motor motor = accepted(text).masses[0].motor;
  EXPECT_EQ(motor.steps_per_revolution, 200);
  EXPECT_EQ(motor.microsteps, 16);
  EXPECT_EQ(motor.gear_ratio, 1);
  EXPECT_EQ(motor.travel_per_revolution, 0);
  EXPECT_EQ(motor.shaft_ratio, 1);
  const double inertia = 0.5 * 1.5 * 1.5;
  const double holding = 3 * (0.5 * 9 * 1.5 + (1 + 3) * inertia * 4);
  // The same products, perhaps in another order.
  EXPECT_DOUBLE_EQ(motor.holding_torque_nm, holding);
  EXPECT_DOUBLE_EQ(motor.detent_torque_nm, 0.04 * holding);
  EXPECT_DOUBLE_EQ(motor.rotor_inertia_kgm2, 3 * inertia);
  // theta' = t - 2.5 t^2 is greatest, 1.5 in size, at the end; there a tenth of the torque is less than damping ratio
  // 0.2 takes.
  EXPECT_DOUBLE_EQ(motor.viscous_damping_nms, 0.1 * holding / 1.5);
  EXPECT_EQ(motor.corner_speed_radps, 30);
  EXPECT_EQ(motor.step_error, 0.015);
  EXPECT_DOUBLE_EQ(motor.max_acceleration, 0.5 * holding / (4 * inertia));
  // Nine tenths of the torque less half of it for that acceleration and the weight's: what drag may take.
  const double per_radian = 3200 / (2 * pi), drag = 0.4 * holding - 0.5 * 9 * 1.5;
  EXPECT_DOUBLE_EQ(motor.max_step_rate_hz, drag / motor.viscous_damping_nms * per_radian);
  // In one swing on the stiffness 50 holding.
  EXPECT_DOUBLE_EQ(motor.max_jerk, motor.max_acceleration / (2 * pi * std::sqrt(4 * inertia / (50 * holding))));

  const Motor geared = accepted(text, {"mass.0.motor.gear_ratio=5", "mass.0.initial_velocity=10"}).masses[0].motor;
  EXPECT_DOUBLE_EQ(geared.holding_torque_nm, holding / 5);
  EXPECT_DOUBLE_EQ(geared.rotor_inertia_kgm2, 3 * inertia / 25);
  EXPECT_DOUBLE_EQ(geared.viscous_damping_nms, 0.1 * (holding / 5) / (5 * 10.1));
  EXPECT_DOUBLE_EQ(geared.corner_speed_radps, 2 * 5 * 10.1);  // theta' = 10 + t - 2.5 t^2, greatest at t = 0.2
  EXPECT_DOUBLE_EQ(geared.max_acceleration, 0.5 * holding / (4 * inertia));

  EXPECT_EQ(motor.direction_setup_s, 2e-6);
  // Where the torque is as good as gone, the motion still decides, and a tenth is left.
  const Motor weak = accepted(text, {"mass.0.motor.holding_torque=8"}).masses[0].motor;
  EXPECT_DOUBLE_EQ(weak.max_step_rate_hz, 1.1 * 1.5 * per_radian);
  // Ideal masses have to catch up with a motion that the governor has bent.
  const std::vector<std::string> ideal = {"mass.0.motor.holding_torque=8", "run.actuation=ideal"};
  EXPECT_DOUBLE_EQ(accepted(text, ideal).masses[0].motor.max_step_rate_hz, 1.1 * 1.5 * per_radian);
  std::vector<std::string> governed = ideal;
  governed.emplace_back("control.governor=true");
  EXPECT_DOUBLE_EQ(accepted(text, governed).masses[0].motor.max_step_rate_hz, 2 * 1.5 * per_radian);
  // Without drag the corner speed of 30 rad/s, if the controller can issue that and the timer time it.
  std::vector<std::string> free = {"mass.0.motor.viscous_damping=0"};
  EXPECT_DOUBLE_EQ(accepted(text, free).masses[0].motor.max_step_rate_hz, 30 * per_radian);
  free.push_back("mass.0.motor.microsteps=256");
  EXPECT_DOUBLE_EQ(accepted(text, free).masses[0].motor.max_step_rate_hz, 60000);
  free.insert(free.end(), {"run.timer_frequency=1e6", "run.control_period=1e-4"});
  EXPECT_DOUBLE_EQ(accepted(text, free).masses[0].motor.max_step_rate_hz, 1e5);
}

TEST(MotorDefaults, OnALine) {
  const Motor motor = accepted(on_line("motion = [{ duration = 1, acceleration = [0.5, -0.5] }]\n")).masses[0].motor;
  EXPECT_EQ(motor.travel_per_revolution, 1);  // half the ball's radius
  const double ratio = 2 * pi;
  EXPECT_DOUBLE_EQ(motor.shaft_ratio, ratio);
  const double holding = 3 * (0.5 * 1 + (1 + 3) * 0.5 * 0.5) / ratio;
  EXPECT_DOUBLE_EQ(motor.holding_torque_nm, holding);
  const double load = 0.5 / (ratio * ratio);
  EXPECT_DOUBLE_EQ(motor.rotor_inertia_kgm2, 3 * load);
  // theta' = 0.5 t - 0.5 t^2 is greatest, 0.125, in the middle.
  EXPECT_DOUBLE_EQ(motor.viscous_damping_nms, 0.1 * holding / (0.125 * ratio));
  EXPECT_DOUBLE_EQ(motor.max_acceleration, 0.5 * ratio * holding / (4 * 0.5));
}

TEST(MotorDefaults, WithoutWeightAndMotionTheMotorStillHolds) {
  const Motor motor = accepted(on_line(""), {"gravity=0"}).masses[0].motor;
  EXPECT_DOUBLE_EQ(motor.holding_torque_nm, 3 * 4 * 0.5 / (2 * pi));  // as for 1 m/s^2
  const double load = 0.5 / (4 * pi * pi);
  EXPECT_DOUBLE_EQ(motor.viscous_damping_nms, 0.4 * std::sqrt(50 * motor.holding_torque_nm * 4 * load));  // never moves
}

TEST(MotorDefaults, FollowWhatIsGiven) {
  const Motor motor =
      accepted(on_line("[mass.motor]\nholding_torque = 2\nrotor_inertia = 0.25\nsteps_per_revolution = 400\n"))
          .masses[0]
          .motor;
  EXPECT_DOUBLE_EQ(motor.detent_torque_nm, 0.08);
  EXPECT_DOUBLE_EQ(motor.viscous_damping_nms, 0.4 * std::sqrt(100 * 2 * (0.25 + 0.5 / (4 * pi * pi))));
  EXPECT_DOUBLE_EQ(motor.max_acceleration, 0.5 * 2 * pi * 2 / (0.5 + 0.25 * 4 * pi * pi));
}

TEST(MotorDefaults, ThatCannotBeUsedAreReported) {
  // A load inertia of 0.25 * 0.3^2 / (1e-12)^2 is no motor's; three times that is 6.75e22.
  const ScenarioResult result = parse(kFull, {"mass.2.motor.gear_ratio=1e-12"});
  ASSERT_FALSE(result.ok());
  bool named = false;
  for (const ScenarioError& error : result.errors) {
    named = named || (error.key == "mass.2.motor.rotor_inertia" && contains(error.message, "its default 6.75e+22"));
  }
  EXPECT_TRUE(named) << all_errors(result);
}

TEST(MotorDefaults, NeverRefuseTheMotion) {
  // A motor too weak for its motion, and one too soft for it: only a limit somebody has set refuses a motion.
  const std::string text = on_line("motion = [{ duration = 0.001, acceleration = [0, 3] }]\n");
  const Motor motor = accepted(text, {"mass.0.motor.holding_torque=1e-6"}).masses[0].motor;
  EXPECT_EQ(motor.max_acceleration, 3);
  EXPECT_DOUBLE_EQ(motor.max_jerk, 3000);
}

TEST(MotorPreset, IsTheDatasheetUnlessTheScenarioSaysOtherwise) {
  const std::string text = on_line("[mass.motor]\npreset = \"nema23\"\nholding_torque = 1.0\n");
  const Motor motor = accepted(text).masses[0].motor;
  EXPECT_EQ(motor.steps_per_revolution, 200);
  EXPECT_EQ(motor.holding_torque_nm, 1.0);
  EXPECT_EQ(motor.detent_torque_nm, 0.039);
  EXPECT_EQ(motor.rotor_inertia_kgm2, 300e-7);
  EXPECT_EQ(motor.rated_current_a, 2.8);
  EXPECT_EQ(motor.resistance_ohm, 0.9);
  EXPECT_EQ(motor.inductance_h, 2.5e-3);
  EXPECT_EQ(motor.supply_voltage_v, 30);
  // Where resistance and back EMF on one axis and inductance on the other need the whole supply.
  const double amplitude = std::sqrt(2) * 2.8, w = motor.corner_speed_radps;
  EXPECT_NEAR(std::hypot(0.9 * amplitude + 1.0 / amplitude * w, 50 * 2.5e-3 * w * amplitude), 30, 1e-12);
  EXPECT_TRUE(accepted(text, {"mass.0.motor.supply_voltage=48"}).masses[0].motor.corner_speed_radps > w);
  // The NEMA 11's detent torque is not printed.
  EXPECT_EQ(accepted(text, {"mass.0.motor.preset=nema11"}).masses[0].motor.detent_torque_nm, 0.04 * 1.0);
  // A corner speed of the scenario's own takes the place of the winding.
  const Motor plain = accepted(text, {"mass.0.motor.corner_speed=12"}).masses[0].motor;
  EXPECT_EQ(plain.corner_speed_radps, 12);
  EXPECT_FALSE(plain.has_winding());
}

TEST(MotorWinding, IsAllOrNothingAndHasToSuitItsSupply) {
  const std::string keys[] = {"rated_current=1", "resistance=4.5", "inductance=7.5e-3", "supply_voltage=24"};
  std::vector<std::string> all;
  for (const std::string& key : keys) all.push_back("mass.0.motor." + key);
  EXPECT_TRUE(accepted(on_line(""), all).masses[0].motor.has_winding());
  EXPECT_FALSE(accepted(on_line("")).masses[0].motor.has_winding());
  for (std::size_t left_out = 0; left_out < all.size(); ++left_out) {
    auto some = all;
    some.erase(some.begin() + static_cast<std::ptrdiff_t>(left_out));
    const ScenarioError error = only_error(on_line(""), some);
    EXPECT_EQ(error.key, all[left_out].substr(0, all[left_out].find('=')));
    EXPECT_TRUE(contains(error.message, "is missing")) << error.message;
  }
  all[3] = "mass.0.motor.supply_voltage=6.36";  // sqrt(2) 1 A 4.5 ohm = 6.364 V
  const ScenarioError starved = only_error(on_line(""), all);
  EXPECT_EQ(starved.key, "mass.0.motor.supply_voltage");
  EXPECT_TRUE(contains(starved.message, "rated_current * resistance = 6.36396")) << starved.message;
  all[3] = "mass.0.motor.supply_voltage=6.37";
  EXPECT_TRUE(accepted(on_line(""), all).id != 0);
}

TEST(MotorWinding, RefusesNonsense) {
  const std::string text = on_line("[mass.motor]\npreset = \"nema17\"\n");
  for (const std::string key : {"rated_current", "resistance", "inductance", "supply_voltage"}) {
    for (const std::string value : {"0", "-1", "nan", "inf", "much"}) {
      const ScenarioError error = only_error(text, {"mass.0.motor." + key + "=" + value});
      EXPECT_EQ(error.key, "mass.0.motor." + key);
      EXPECT_EQ(error.source, "--set");
      EXPECT_TRUE(contains(error.message, "allowed: a finite number > 0, in ")) << error.message;
    }
  }
  // Figures that do not go together: 1e4 N m from 1e-15 A are 7e18 V s, and 24 V are then reached at 3e-18 rad/s.
  const ScenarioError tiny = only_error(text, {"mass.0.motor.rated_current=1e-15", "mass.0.motor.holding_torque=1e4"});
  EXPECT_EQ(tiny.key, "mass.0.motor.rated_current");
  EXPECT_TRUE(contains(tiny.message, "corner speed")) << tiny.message;
  // Two accounts of how torque falls with speed.
  const ScenarioError both = only_error(text, {"mass.0.motor.corner_speed=30", "mass.0.motor.inductance=1e-3"});
  EXPECT_EQ(both.key, "mass.0.motor.corner_speed");
  EXPECT_TRUE(contains(both.message, "follows from the winding")) << both.message;
}

TEST(MotorWinding, IsPartOfTheScenariosFingerprint) {
  const std::string text = on_line("[mass.motor]\npreset = \"nema17\"\n");
  const std::int64_t id = accepted(text).id;
  for (const char* other :
       {"rated_current=1.1", "resistance=4.6", "inductance=7e-3", "supply_voltage=25", "corner_speed=30"}) {
    EXPECT_NE(accepted(text, {std::string("mass.0.motor.") + other}).id, id) << other;
  }
}

TEST(Acceleration, AMotionTooHardForTheMotorIsAnErrorOfItsPiece) {
  const std::string text =
      on_line("motion = [{ duration = 0.5, acceleration = [1, 1] }, { duration = 0.25, acceleration = [-2, 1] }]\n");
  EXPECT_TRUE(accepted(text, {"mass.0.motor.max_acceleration=2", "mass.0.motor.max_jerk=12"}).id != 0);
  const ScenarioError hard = only_error(text, {"mass.0.motor.max_acceleration=1.999"});
  EXPECT_EQ(hard.key, "mass.0.motion.1");
  EXPECT_TRUE(contains(hard.message, "acceleration 2; allowed: <= 1.999 (motor.max_acceleration)")) << hard.message;
  const ScenarioError jerky = only_error(text, {"mass.0.motor.max_jerk=11.99"});
  EXPECT_EQ(jerky.key, "mass.0.motion.1");
  EXPECT_TRUE(contains(jerky.message, "jerk 12; allowed: <= 11.99 (motor.max_jerk)")) << jerky.message;
  EXPECT_TRUE(accepted(text, {"mass.0.motor.max_jerk=1", "run.actuation=prescribed"}).id != 0);
}

TEST(StepRate, AMotionTooFastForTheMotorIsAnErrorOfItsPiece) {
  // 1 turn of motor per m, 3200 microsteps per turn. Speeds: 0.5 m/s after piece 0, 1 m/s after piece 1, 0 after
  // piece 2.
  const std::string text = on_line(
      "motion = [{ duration = 0.5, acceleration = [1, 1] }, { duration = 0.5, acceleration = [1, 1] },"
      "{ duration = 1, acceleration = [-1, -1] }]\n");
  EXPECT_TRUE(accepted(text, {"mass.0.motor.max_step_rate=3200"}).id != 0);
  const ScenarioError error = only_error(text, {"mass.0.motor.max_step_rate=3199"});
  EXPECT_EQ(error.key, "mass.0.motion.1");
  EXPECT_TRUE(contains(error.message, "3200 microsteps/s at its greatest speed 1"));
  EXPECT_TRUE(contains(error.message, "allowed: <= 3199 (motor.max_step_rate)"));
  // Prescribed masses have no motors to outrun.
  EXPECT_TRUE(accepted(text, {"mass.0.motor.max_step_rate=3199", "run.actuation=prescribed"}).id != 0);
}

TEST(StepRate, TheControllerIssuesOnlySoManyStepsPerTick) {
  const std::string text = on_line("initial_velocity = 0.25\n");  // 800 microsteps/s
  EXPECT_TRUE(accepted(text, {"run.control_period=0.07"}).id != 0);
  const ScenarioError error = only_error(text, {"run.control_period=0.08"});
  EXPECT_EQ(error.key, "mass.0.initial_velocity");
  EXPECT_TRUE(contains(error.message, "allowed: <= 750 (motor.max_step_rate)")) << error.message;
}

// A value that the controller would refuse is refused with its key and file first.
TEST(Steps, TheInitialPositionHasToBeCountable) {
  const std::vector<std::string> one_to_one = {"mass.0.motor={steps_per_revolution=4, microsteps=250}",
                                               "mass.0.motion=[]"};
  const auto with = [&](const std::string& more, const std::string& actuation = "stepper") {
    std::vector<std::string> overrides = one_to_one;
    overrides.push_back("run.actuation=" + actuation);
    overrides.push_back("mass.0.initial_position=" + more);
    return overrides;
  };
  // 1000 microsteps a turn: 1e15 of them are 2 pi 1e12.
  EXPECT_TRUE(parse(kFull, with("6.28e12")).ok()) << all_errors(parse(kFull, with("6.28e12")));
  for (const char* far : {"6.29e12", "-6.29e12", "1e14"}) {
    const ScenarioError error = only_error(kFull, with(far));
    EXPECT_EQ(error.key, "mass.0.initial_position");
    EXPECT_EQ(error.value, far);
    EXPECT_TRUE(contains(error.message, "allowed: within 1e+15 microsteps, here 6283185307179.58"));
  }
  EXPECT_TRUE(parse(kFull, with("6.29e12", "prescribed")).ok());
}

TEST(Steps, TheMotorsRateEndsAtTheTimers) {
  const std::string short_ticks = "run.control_period=2e-5";
  EXPECT_TRUE(accepted(kFull, {short_ticks, "mass.1.motor.max_step_rate=1e6"}).id != 0);
  const ScenarioError error = only_error(kFull, {short_ticks, "mass.1.motor.max_step_rate=1000001"});
  EXPECT_EQ(error.key, "mass.1.motor.max_step_rate");
  EXPECT_TRUE(contains(error.message, "<= run.timer_frequency = 1e+06"));
}

// Three motors have 10 bursts each: 28 steps in a control period of 2 ms, one of them beyond the mean.
TEST(StepRate, EndsAtTheMotorsShareOfTheBursts) {
  EXPECT_TRUE(accepted(kFull, {"mass.1.motor.max_step_rate=13500"}).id != 0);
  const ScenarioError error = only_error(kFull, {"mass.1.motor.max_step_rate=13501"});
  EXPECT_EQ(error.key, "mass.1.motor.max_step_rate");
  EXPECT_EQ(error.value, "13501");
  EXPECT_TRUE(contains(error.message, "allowed: <= 13500, 27 steps in a run.control_period")) << error.message;
  // Prescribed masses issue no steps.
  EXPECT_TRUE(accepted(kFull, {"mass.1.motor.max_step_rate=13501", "run.actuation=prescribed"}).id != 0);
  // A default stays within the bound.
  const std::vector<std::string> fast = {"mass.1.motor={microsteps=256, viscous_damping=0}"};
  const Mass mass = accepted(kFull, fast).masses[1];
  EXPECT_EQ(mass.motor.max_step_rate_hz, 13500);
}

TEST(StepRate, OfTheShippedDefaultsLeavesRoom) {
  const Mass mass = accepted(kFull).masses[1];
  EXPECT_LT(speed_extent(mass).greatest_speed * mass.motor.shaft_ratio / (2 * pi) * 3200, mass.motor.max_step_rate_hz);
}

}  // namespace
}  // namespace ballast::sim
