// Values that are allowed and that no robot has are named with what is likely meant; sound robots have none.
#include "sim/scenario/plausibility.h"

#include <cmath>

#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

const std::string kSound = R"(duration = 4.0
gravity = 9.81
[ball]
radius = 0.1
mass = 0.5
inertia = [0.003, 0.003, 0.003]
[surface]
static_friction = 0.5
[[mass]]
mass = 0.1
rail = { shape = "circle", radius = 0.07, axes = [[0, 0, -1], [1, 0, 0]] }
motion = [ { duration = 1.0, acceleration = [0.1, -0.1] } ]
[[mass]]
mass = 0.1
rail = { shape = "circle", radius = 0.05, axes = [[0, 0, -1], [0, 1, 0]] }
)";

struct Doubt {
  const char* set;
  const char* key;
  const char* meaning;
};

class Implausible : public testing::TestWithParam<Doubt> {};

TEST_P(Implausible, IsNamedWithItsLikelyMeaning) {
  const Doubt& doubt = GetParam();
  const ScenarioResult result = parse(kSound, {doubt.set});
  ASSERT_TRUE(result.ok()) << all_errors(result);
  ASSERT_EQ(result.warnings.size(), 1u) << doubt.set;
  EXPECT_EQ(result.warnings[0].key, doubt.key);
  EXPECT_TRUE(contains(result.warnings[0].message, doubt.meaning));
}

INSTANTIATE_TEST_SUITE_P(
    Value, Implausible,
    testing::Values(
        Doubt{"gravity=9810", "gravity", "9810 mm/s^2"},
        Doubt{"ball.inertia=[0.01, 0.01, 0.01]", "ball.inertia.0", "no body inside the ball exceeds"},
        Doubt{"ball.mass=500", "ball.mass", "masses in g"},
        Doubt{"surface.static_friction=50", "surface.static_friction", "more than any floor"},
        Doubt{"mass.1.rail={ shape = \"circle\", radius = 0.05, direction = { azimuth = 0, elevation = 60 } }",
              "mass.1.rail.direction.elevation", "write 1.047"},
        Doubt{"mass.1.rail={ shape = \"circle\", radius = 0.05, direction = { azimuth = 90, elevation = 0 } }",
              "mass.1.rail.direction.azimuth", "write 1.5707"},
        Doubt{"surface.patch=[{circle={center=[0, 0], radius=1}}]", "surface.patch.0", "like the floor"},
        Doubt{"surface={static_friction=0.5, rolling_resistance=0.01, creep=1e-8}", "surface.creep", "small steps"},
        Doubt{"believed={ball={mass=1}}", "believed.ball.mass", "a factor of 2 away"},
        Doubt{"believed={mass=[{mass=0.0001}, {}]}", "believed.mass.0.mass", "is believed where the truth is"},
        Doubt{"believed={surface={static_friction=0.1}}", "believed.surface.static_friction", "a factor of 5 away"},
        Doubt{"mass.1.rail.radius=0.07", "mass.1.rail", "rail of mass.0"},
        Doubt{"mass.1.rail={ shape = \"circle\", radius = 0.07, axes = [[0, 0, -1], [1, 0, 0]] }", "mass.1.rail",
              "is the rail of mass.0"}));

TEST(Plausibility, ASoundRobotHasNoWarning) {
  const ScenarioResult result = parse(kSound);
  ASSERT_TRUE(result.ok()) << all_errors(result);
  for (const ScenarioError& warning : result.warnings) ADD_FAILURE() << to_string(warning);
}

TEST(Plausibility, ARobotInMillimetresAndGramsIsNamedByItsRadius) {
  std::string robot = replaced(kSound, "radius = 0.1\nmass = 0.5", "radius = 100\nmass = 500");
  robot = replaced(robot, "[0.003, 0.003, 0.003]", "[3e6, 3e6, 3e6]");
  const ScenarioResult result =
      parse(replaced(replaced(robot, "radius = 0.07", "radius = 70"), "radius = 0.05", "radius = 50"));
  ASSERT_TRUE(result.ok()) << all_errors(result);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].key, "ball.radius");
  EXPECT_EQ(result.warnings[0].line, 4);
  EXPECT_TRUE(contains(result.warnings[0].message, "0.1 m"));
}

TEST(Plausibility, AFloorThatIsNotGivenIsOneOfInfiniteFriction) {
  const ScenarioResult result = parse(replaced(kSound, "[surface]\nstatic_friction = 0.5\n", ""));
  ASSERT_TRUE(result.ok()) << all_errors(result);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].key, "surface.static_friction");
  EXPECT_TRUE(contains(result.warnings[0].message, "never trips"));
}

// Circles in one plane are as far apart as their radii; crossing lines meet; a closed form for each.
TEST(Plausibility, RailDistanceIsTheLeast) {
  const Eigen::Vector3d x(1, 0, 0), y(0, 1, 0), z(0, 0, 1), zero(0, 0, 0);
  EXPECT_NEAR(rail_distance_m(firmware::circle(zero, 0.9, x, z), firmware::circle(zero, 0.8, x, z)), 0.1, 1e-9);
  EXPECT_NEAR(rail_distance_m(firmware::circle(zero, 0.9, x, z), firmware::circle(zero, 0.9, y, z)), 0, 1e-5);
  EXPECT_NEAR(rail_distance_m(firmware::circle({0, 0.3, 0}, 0.5, x, z), firmware::circle({0, -0.1, 0}, 0.5, x, z)), 0.4,
              1e-9);
  firmware::Rail a = firmware::line({0, 0, 0.2}, x), b = firmware::line({0.1, 0, -0.1}, y);
  for (firmware::Rail* rail : {&a, &b}) {
    rail->lower_end = -0.7;
    rail->upper_end = 0.7;
  }
  EXPECT_NEAR(rail_distance_m(a, b), 0.3, 1e-9);
}

TEST(Plausibility, ATaskWithoutAMotionIsNamed) {
  const std::string task = kSound.substr(0, kSound.find("motion")) + "[task]\ngoal = [0.1, 0]\nduration = 1\n";
  const ScenarioResult unplanned = parse(task);
  ASSERT_TRUE(unplanned.ok()) << all_errors(unplanned);
  ASSERT_EQ(unplanned.warnings.size(), 1u);
  EXPECT_EQ(unplanned.warnings[0].key, "task");
  EXPECT_TRUE(contains(unplanned.warnings[0].message, "`ballast plan "));
  EXPECT_TRUE(parse(kSound + "[task]\ngoal = [0.1, 0]\nduration = 1\n").warnings.empty());
}

}  // namespace
}  // namespace ballast::sim
