// [[surface.patch]]: what is read, what is refused, and what is believed of it.
#include <cmath>
#include <limits>

#include "sim/plant/local_floor.h"
#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

const std::string kFloor =
    kMinimal + "[surface]\nstatic_friction = 0.5\nkinetic_friction = 0.4\nrolling_resistance = 0.01\n";

std::string patch(const std::string& keys) { return kFloor + "[[surface.patch]]\n" + keys + "\n"; }

std::string square(const std::string& more = "") {
  return patch("polygon = [[0, 0], [1, 0], [1, 1], [0, 1]]\n" + more);
}

TEST(Patch, IsReadWithTheFloorsValuesWhereItHasNone) {
  const Scenario s =
      accepted(square() +
               "[[surface.patch]]\ncircle = { center = [1.5, -2], radius = 0.25 }\nstatic_friction = 0.3\n"
               "kinetic_friction = 0.2\nrolling_resistance = 0\n");
  ASSERT_EQ(s.surface.patches.size(), 2u);
  const SurfacePatch &a = s.surface.patches[0], &b = s.surface.patches[1];
  ASSERT_EQ(a.polygon_W_m.size(), 4u);
  EXPECT_EQ(a.polygon_W_m[1], Eigen::Vector2d(1, 0));
  EXPECT_EQ(a.static_friction, 0.5);
  EXPECT_EQ(a.kinetic_friction, 0.4);
  EXPECT_EQ(a.rolling_resistance, 0.01);
  EXPECT_TRUE(b.polygon_W_m.empty());
  EXPECT_EQ(b.center_W_m, Eigen::Vector2d(1.5, -2));
  EXPECT_EQ(b.radius_m, 0.25);
  EXPECT_EQ(b.static_friction, 0.3);
  EXPECT_EQ(b.kinetic_friction, 0.2);
  EXPECT_EQ(b.rolling_resistance, 0);
  EXPECT_EQ(s.surface.greatest_static_friction(), 0.5);
}

TEST(Patch, HasNoMoreKineticFrictionThanStatic) {
  EXPECT_EQ(accepted(square("static_friction = 0.1")).surface.patches[0].kinetic_friction, 0.1);
  EXPECT_EQ(accepted(square("static_friction = 0.9")).surface.patches[0].kinetic_friction, 0.4);
  EXPECT_EQ(accepted(square("static_friction = inf")).surface.patches[0].static_friction, kInf);
}

TEST(Patch, BordersAreWhatASimplePolygonHas) {
  // Both directions round, not convex, and with a corner on a straight edge.
  for (const char* corners : {"[[0, 0], [0, 1], [1, 1], [1, 0]]", "[[0, 0], [2, 0], [2, 1], [1, 1], [1, 3], [0, 3]]",
                              "[[0, 0], [1, 0], [2, 0], [1, 1]]", "[[0, 0], [1e-3, 0], [0, 1e-3]]"}) {
    accepted(patch(std::string("polygon = ") + corners));
  }
}

TEST(Patch, EachWrongKeyIsOneError) {
  std::string many = "[[0, 0]", patches = kFloor;
  for (int i = 1; i <= 64; ++i)
    many += ", [" + std::to_string(std::cos(0.09 * i)) + ", " + std::to_string(std::sin(0.09 * i)) + "]";
  for (int i = 0; i <= 64; ++i) patches += "[[surface.patch]]\ncircle = { center = [0, 0], radius = 1 }\n";
  const std::string at = "surface.patch.0";
  const struct {
    std::string text, key, says;
  } cases[] = {
      {patch("static_friction = 0.1"), at + ".polygon", "is missing"},
      {square("circle = { center = [0, 0], radius = 1 }"), at + ".circle", "one of both"},
      {patch("polygon = [[0, 0], [1, 0]]"), at + ".polygon", "3 to 64"},
      {patch("polygon = " + many + "]"), at + ".polygon", "3 to 64"},
      {patch("polygon = [[0, 0], [1, 0], [2, 0]]"), at + ".polygon", "no area"},
      {patch("polygon = [[0, 0], [1, 0], [1, 0], [0, 1]]"), at + ".polygon", "twice"},
      {patch("polygon = [[0, 0], [1, 0], [0, 1], [0, 0]]"), at + ".polygon", "twice"},
      {patch("polygon = [[0, 0], [1, 1], [1, 0], [0, 2]]"), at + ".polygon", "crosses"},
      {patch("polygon = [[0, 0], [1, 1], [1, 0], [0, 1]]"), at + ".polygon", "crosses"},          // its halves cancel
      {patch("polygon = [[0, 0], [2, 0], [1, 0], [1, 1]]"), at + ".polygon", "crosses"},          // folds back
      {patch("polygon = [[1, 1], [0, 0], [2, 0], [1, 0]]"), at + ".polygon", "crosses"},          // at its end too
      {patch("polygon = [[0, 0], [2, 0], [2, 1], [1, 0], [0, 1]]"), at + ".polygon", "touches"},  // a corner on an edge
      {patch("polygon = [[0, 0], [1, 0], [nan, 1]]"), at + ".polygon.2.0", "finite"},
      {patch("polygon = [[0, 0], [1, 0], [1, 1e16]]"), at + ".polygon.2.1", "finite"},
      {patch("polygon = [[0, 0], [1, 0], [1, 1, 0]]"), at + ".polygon.2", "2 numbers"},
      {patch("polygon = 3"), at + ".polygon", "array"},
      {patch("circle = { center = [0, 0], radius = 0 }"), at + ".circle.radius", "> 0"},
      {patch("circle = { center = [0, 0], radius = -1 }"), at + ".circle.radius", "> 0"},
      {patch("circle = { center = [0, 0], radius = nan }"), at + ".circle.radius", "> 0"},
      {patch("circle = { center = [0, 0, 0], radius = 1 }"), at + ".circle.center", "2 numbers"},
      {patch("circle = { center = [0, nan], radius = 1 }"), at + ".circle.center.1", "finite"},
      {patch("circle = { center = [0, 0], radius = 1, height = 2 }"), at + ".circle.height", "unknown"},
      {patch("circle = { radius = 1 }"), at + ".circle.center", "missing from circle of [[surface.patch]] 0"},
      {patch("circle = 1"), at + ".circle", "table"},
      {square("static_friction = 0"), at + ".static_friction", "> 0"},
      {square("static_friction = nan"), at + ".static_friction", "> 0"},
      {square("kinetic_friction = 0.6"), at + ".kinetic_friction", "0.5"},
      {square("rolling_resistance = -0.1"), at + ".rolling_resistance", ">= 0"},
      {square("rolling_resistance = nan"), at + ".rolling_resistance", ">= 0"},
      {square("static_fricton = 0.1"), at + ".static_fricton", "allowed in [[surface.patch]] 0: "},
      {square("slope = { angle = 0.1 }"), at + ".slope", "unknown"},
      {patches, "surface.patch", "at most 64"},
      {kFloor + "patch = 3\n", "surface.patch", "array"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.text);
    const ScenarioError error = only_error(c.text);
    EXPECT_EQ(error.key, c.key);
    EXPECT_NE(error.message.find(c.says), std::string::npos) << error.message;
  }
}

TEST(Patch, EveryKeyCountsInTheFingerprint) {
  const std::string round = patch("circle = { center = [0, 0], radius = 1 }");
  std::vector<std::int64_t> ids{accepted(kFloor).id};
  for (const std::string& text :
       {square(), square("static_friction = 0.3"), square("kinetic_friction = 0.3"), square("rolling_resistance = 0.3"),
        patch("polygon = [[0, 0], [1, 0], [1, 2], [0, 1]]"), patch("polygon = [[0, 0], [1, 0], [1, 1]]"), round,
        patch("circle = { center = [0, 0.5], radius = 1 }"), patch("circle = { center = [0, 0], radius = 2 }"),
        round + "[[surface.patch]]\ncircle = { center = [0, 0], radius = 1 }\n"}) {
    const std::int64_t id = accepted(text).id;
    for (const std::int64_t other : ids) EXPECT_NE(id, other) << text;
    ids.push_back(id);
  }
}

// Nobody is told of the patches: what is believed is the floor between them, written or not.
TEST(Patch, IsNotBelieved) {
  const Scenario bare = accepted(kFloor);
  EXPECT_FALSE(bare.believed);
  const Scenario s = accepted(square("static_friction = 0.1"));
  ASSERT_TRUE(s.believed);
  EXPECT_FALSE(s.belief_is_written);
  EXPECT_TRUE(s.belief().surface.patches.empty());
  EXPECT_EQ(s.belief().surface.static_friction, 0.5);
  EXPECT_TRUE(as_believed(s).surface.patches.empty());
  const Scenario written = accepted(square("static_friction = 0.1") + "[believed]\nball = { mass = 2 }\n");
  EXPECT_TRUE(written.belief_is_written);
  EXPECT_TRUE(written.belief().surface.patches.empty());
  EXPECT_EQ(written.belief().ball.mass_kg, 2);
  EXPECT_EQ(only_error(square() + "[believed]\nsurface = { patch = [] }\n").key, "believed.surface.patch");
}

TEST(Patch, CanBeSetAndIsWrittenDown) {
  const Scenario s = accepted(square(), {"surface.patch.0.static_friction=0.2", "surface.static_friction=0.45"});
  EXPECT_EQ(s.surface.patches[0].static_friction, 0.2);
  EXPECT_EQ(s.surface.patches[0].kinetic_friction, 0.2);
  EXPECT_EQ(accepted(s.toml).id, s.id);
}

TEST(Patch, AStartInSlidingIsJudgedByTheFloorOfItsPlace) {
  const std::string sliding = "[initial]\nvelocity = [1, 0, 0]\nposition = [0.5, 0.5]\n";
  EXPECT_EQ(only_error(square("static_friction = inf\nkinetic_friction = inf") + sliding).key, "initial.velocity");
  accepted(square("static_friction = inf\nkinetic_friction = inf") +
           "[initial]\nvelocity = [1, 0, 0]\n"
           "position = [3, 0.5]\n");
}

TEST(Patch, AFaultMayLowerTheFrictionOfTheRoughestPlace) {
  const auto with_fault = [](double value) {
    return parse_scenario(square("static_friction = 0.9"), "test.toml", {},
                          {"friction_falls@1:" + std::to_string(value)});
  };
  EXPECT_TRUE(with_fault(0.7).ok());
  EXPECT_FALSE(with_fault(0.95).ok());
}

}  // namespace
}  // namespace ballast::sim
