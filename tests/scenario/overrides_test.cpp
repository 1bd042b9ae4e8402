// --set: what an assignment may look like, and what it reaches.
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "tests/scenario/scenario_texts.h"

namespace ballast::sim {
namespace {

TEST(Overrides, ReachEveryDepthAndCountFromZero) {
  const Scenario s =
      accepted(kFull, {"duration=3", "ball.center_of_mass=[0, 0, 0.5]", "mass.2.mass=60", "mass.0.rail.radius=1.25",
                       "mass.0.motion.1.duration=0.75", "mass.2.rail.axes.1=[0, 1, 0]", "ball.inertia.0=1.05"});
  EXPECT_EQ(s.duration_s, 3);
  EXPECT_EQ(s.ball.center_of_mass_B_m[2], 0.5);
  EXPECT_EQ(s.masses[2].mass_kg, 60);
  EXPECT_EQ(s.masses[0].rail.radius_m, 1.25);
  EXPECT_EQ(s.masses[0].motion[1].duration_s, 0.75);
  EXPECT_EQ(s.masses[2].rail.axis_sin_B, Eigen::Vector3d(0, 1, 0));
  EXPECT_EQ(s.ball.inertia_kgm2[0], 1.05);
}

TEST(Overrides, CreateMissingTables) {
  const Scenario s = accepted(kMinimal, {"surface.static_friction=0.17", "run.actuation=prescribed", "seed=5"});
  EXPECT_EQ(s.surface.static_friction, 0.17);
  EXPECT_EQ(s.run.actuation, Actuation::kPrescribed);
  EXPECT_EQ(s.seed, 5u);
  EXPECT_EQ(accepted(kFull, {"mass.2.motor.microsteps=64"}).masses[2].motor.microsteps, 64);
}

// A smoother floor takes the kinetic friction of the file down with it, in the file that is left too.
TEST(Overrides, ASmootherFloorIsWrittenDownWhole) {
  const Scenario s = accepted(kFull, {"surface.static_friction=0.01"});
  ASSERT_EQ(s.surface.kinetic_friction, 0.01);
  EXPECT_EQ(accepted(s.toml).id, s.id);
}

TEST(Overrides, MakeAWholeScenario) {
  const Scenario s = accepted("", {"duration=1", "gravity=1", "ball={radius=1, mass=1, inertia=[1,1,1]}",
                                   "mass=[{mass=1, rail={shape=\"line\", origin=[0,0,0], direction=[1,0,0]}}]"});
  EXPECT_EQ(s.masses.size(), 1u);
}

TEST(Overrides, ValueIsTomlElseABareString) {
  EXPECT_EQ(accepted(kFull, {"run.actuation=prescribed"}).run.actuation, Actuation::kPrescribed);
  EXPECT_EQ(accepted(kFull, {"run.actuation=\"prescribed\""}).run.actuation, Actuation::kPrescribed);
  EXPECT_EQ(accepted(kFull, {"name=a-b.c"}).name, "a-b.c");
  EXPECT_EQ(accepted(kFull, {" gravity = 1_0.5e-1 "}).gravity_mps2, 1.05);
  EXPECT_EQ(accepted(kFull, {"gravity=0x10"}).gravity_mps2, 16);
  // More than one value is no TOML value: it must not slip in as a second key.
  const ScenarioError error = only_error(kFull, {"gravity=1\nduration=2"});
  EXPECT_EQ(error.key, "gravity");
  EXPECT_TRUE(contains(error.message, "a string"));
  EXPECT_TRUE(contains(only_error(kFull, {"gravity="}).message, "is empty"));
  EXPECT_TRUE(contains(only_error(kFull, {"gravity=1e400"}).message, "is too large for a number"));
  EXPECT_TRUE(contains(only_error(kFull, {"gravity=99999999999999999999"}).message, "is too large for an integer"));
  for (const std::string text : {".1", "-.5", "1.", "012"}) {
    EXPECT_TRUE(contains(only_error(kFull, {"gravity=" + text}).message, "is no number of TOML")) << text;
  }
  EXPECT_TRUE(contains(only_error(kFull, {"gravity='1e400'"}).message, "is a string"));
}

TEST(Overrides, TheLastOneWins) { EXPECT_EQ(accepted(kFull, {"gravity=1", "gravity=2"}).gravity_mps2, 2); }

TEST(Overrides, ReplaceAFaultOfTheFile) {
  EXPECT_EQ(accepted(replaced(kFull, "gravity = 9.0", "gravity = -9.0"), {"gravity=1"}).gravity_mps2, 1);
}

TEST(Overrides, AreTheSourceOfTheirErrorsOnly) {
  const ScenarioResult result = parse(replaced(kFull, "gravity = 9.0", "gravity = -9.0"), {"mass.1.mass=-2", "foo=1"});
  ASSERT_EQ(result.errors.size(), 3u) << all_errors(result);
  EXPECT_EQ(to_string(result.errors[2]),
            "test.toml:3: gravity = -9.0: is out of range; allowed: a finite number >= 0, in m/s^2");
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(result.errors[static_cast<std::size_t>(i)].source, "--set");
    EXPECT_EQ(result.errors[static_cast<std::size_t>(i)].line, 0);
  }
}

TEST(Overrides, AKeyMissingFromATableIsTheFaultOfWhoMadeTheTable) {
  const ScenarioResult result = parse("duration = 1\ngravity = 1\n", {"ball.radius=1"});
  ASSERT_EQ(result.errors.size(), 2u) << all_errors(result);
  EXPECT_EQ(result.errors[0].source, "--set");
  EXPECT_EQ(result.errors[0].key, "ball.mass");
  EXPECT_EQ(to_string(only_error(kMinimal, {"mass=[{mass=1}]"})).substr(0, 18), "--set: mass.0.rail");
  const ScenarioError in_the_files_table = only_error(replaced(kMinimal, "mass = 3.0\n", ""), {"ball.radius=1"});
  EXPECT_EQ(in_the_files_table.source, "test.toml");
  EXPECT_EQ(in_the_files_table.line, 3);  // of [ball]
}

TEST(Overrides, MalformedOnesAreErrors) {
  struct Case {
    const char* assignment;
    const char* key;
    const char* value;
    const char* message;
  };
  for (const Case& c : std::vector<Case>{
           {"gravity", "", "gravity", "has no '='"},
           {"", "", "", "has no '='"},
           {"=5", "", "=5", "empty key"},
           {"ball.=5", "", "ball.=5", "empty key"},
           {".mass=5", "", ".mass=5", "empty key"},
           {"ball..mass=5", "", "ball..mass=5", "empty key"},
           {"mass.3.mass=5", "mass.3.mass", "5", "mass has no entry \"3\"; allowed: 0 to 2"},
           {"mass.-1.mass=5", "mass.-1.mass", "5", "allowed: 0 to 2"},
           {"mass.99999999999999999999.mass=5", "mass.99999999999999999999.mass", "5", "allowed: 0 to 2"},
           {"mass.mass=5", "mass.mass", "5", "allowed: 0 to 2"},
           {"mass.0.motion.2.duration=5", "mass.0.motion.2.duration", "5",
            "mass.0.motion has no entry \"2\"; allowed: 0 to 1"},
           {"mass.2.motion.0.duration=5", "mass.2.motion.0.duration", "5", "mass.2.motion has no entries"},
           {"gravity.x=5", "gravity.x", "5", "gravity is a single value"}}) {
    const ScenarioError error = only_error(kFull, {c.assignment});
    EXPECT_EQ(error.source, "--set") << c.assignment;
    EXPECT_EQ(error.key, c.key) << c.assignment;
    EXPECT_EQ(error.value, c.value) << c.assignment;
    EXPECT_TRUE(contains(error.message, c.message)) << c.assignment;
  }
  const ScenarioError none = only_error(kMinimal, {"mass.0.mass=5"});
  EXPECT_TRUE(contains(none.message, "mass has no entries"));
  std::string deep = "a";
  for (int i = 0; i < 100000; ++i) deep += ".a";
  EXPECT_TRUE(contains(only_error(kMinimal, {deep + "=1"}).message, "nested too deep"));
}

TEST(Overrides, ASmootherFloorLowersTheKineticFrictionOfTheFile) {
  EXPECT_EQ(accepted(kFull, {"surface.static_friction=0.17"}).surface.kinetic_friction, 0.17);
  EXPECT_EQ(accepted(kFull, {"surface.static_friction=0.45"}).surface.kinetic_friction, 0.4);
  // Given itself, it has to fit.
  EXPECT_EQ(only_error(kFull, {"surface.static_friction=0.17", "surface.kinetic_friction=0.2"}).key,
            "surface.kinetic_friction");
  EXPECT_EQ(only_error(replaced(kFull, "static_friction = 0.5", "static_friction = 0.3")).key,
            "surface.kinetic_friction");
}

class Files : public ::testing::Test {
 protected:
  void SetUp() override {
    directory_ = std::filesystem::path(::testing::TempDir()) /
                 (std::string("ballast_scenario_") + ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(directory_);
  }
  void TearDown() override { std::filesystem::remove_all(directory_); }
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::ofstream(directory_ / name, std::ios::binary) << text;
    return directory_ / name;
  }
  std::filesystem::path directory_;
};

TEST_F(Files, AreReadWithTheirNameInErrors) {
  const std::filesystem::path file = write("robot.toml", kMinimal);
  const ScenarioResult good = read_scenario(file, {"gravity=2"});
  ASSERT_TRUE(good.ok()) << all_errors(good);
  EXPECT_EQ(good.scenario.name, "robot");
  EXPECT_EQ(good.scenario.gravity_mps2, 2);
  const ScenarioResult bad = read_scenario(write("bad.toml", replaced(kMinimal, "gravity = 1.0", "gravity = -1")));
  ASSERT_EQ(bad.errors.size(), 1u);
  EXPECT_EQ(bad.errors[0].source, (directory_ / "bad.toml").string());
  EXPECT_EQ(bad.errors[0].line, 2);
}

TEST_F(Files, ThatCannotBeReadGiveOneError) {
  const auto error_of = [](const std::filesystem::path& path) {
    const ScenarioResult result = read_scenario(path, {"gravity=-1"});
    EXPECT_EQ(result.errors.size(), 1u) << all_errors(result);
    EXPECT_EQ(result.errors.at(0).source, path.string());
    return result.errors.at(0).message;
  };
  EXPECT_TRUE(contains(error_of(directory_ / "none.toml"), "no such file"));
  EXPECT_TRUE(contains(error_of(""), "no such file"));
  EXPECT_TRUE(contains(error_of(directory_), "is a directory"));
  EXPECT_TRUE(contains(error_of(write("large.toml", std::string((1 << 22) + 1, '#'))), "too large"));
  if (std::filesystem::exists("/dev/zero")) {
    EXPECT_TRUE(contains(error_of("/dev/zero"), "too large"));
  }
}

TEST_F(Files, ThatMayNotBeReadAreSaidToBeSo) {
  const auto shut = [this](const std::filesystem::path& path) {
    std::filesystem::permissions(path, std::filesystem::perms::none);
    // Root may read everything; nobody may not.
    EXPECT_TRUE(geteuid() != 0 || seteuid(65534) == 0);
    const std::string file = (directory_ / "folder/mine.toml").string();
    const ScenarioResult result = read_scenario(find_scenario(file, directory_));
    EXPECT_TRUE(getuid() != 0 || seteuid(0) == 0);
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    return all_errors(result);
  };
  std::filesystem::permissions(directory_, std::filesystem::perms(0755));
  std::filesystem::create_directories(directory_ / "folder");
  write("folder/mine.toml", kMinimal);
  EXPECT_TRUE(contains(shut(directory_ / "folder/mine.toml"), "cannot be read: Permission denied"));
  EXPECT_TRUE(contains(shut(directory_ / "folder"), "cannot be read: Permission denied"));
}

TEST_F(Files, AreFoundByPathOrByShippedName) {
  const std::filesystem::path shipped = directory_ / "shipped";
  std::filesystem::create_directories(shipped);
  write("shipped/one.toml", kMinimal);
  const std::filesystem::path mine = write("mine.toml", kMinimal);
  EXPECT_EQ(find_scenario(mine.string(), shipped), mine);
  EXPECT_EQ(find_scenario("one", shipped), shipped / "one.toml");
  EXPECT_TRUE(find_scenario("two", shipped).empty());
  EXPECT_TRUE(find_scenario("", shipped).empty());
  EXPECT_TRUE(find_scenario("../mine", shipped).empty());  // a name, not a way out of the directory
  // A directory named like a shipped scenario does not hide it; any other directory is for read_scenario to refuse.
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::create_directories(directory_ / "work" / "one");
  std::filesystem::create_directories(directory_ / "work" / "other");
  std::filesystem::current_path(directory_ / "work");
  EXPECT_EQ(find_scenario("one", shipped), shipped / "one.toml");
  EXPECT_EQ(find_scenario("other", shipped), std::filesystem::path("other"));
  std::filesystem::current_path(before);
}

// Printed numbers hold for the scenario as printed: for any way of running it, not for another robot or floor.
TEST(Overrides, TakePublishedNumbersAwayIfTheyChangeTheRobot) {
  EXPECT_EQ(accepted(kFull, {"run.control_period=0.002", "seed=3"}).published.size(), 1u);
  EXPECT_TRUE(accepted(kFull, {"ball.mass=2.5"}).published.empty());
}

TEST(Overrides, AreInTheTextOfTheScenario) {
  const std::vector<std::string> overrides = {"duration=0.1",
                                              "mass.2.motor.microsteps=64",
                                              "mass.0.rail.radius=1.2500000000000002",
                                              "mass.0.motion.1.duration=0.30000000000000004",
                                              "surface.static_friction=inf",
                                              "run.actuation=prescribed",
                                              "seed=9223372036854775807"};
  const Scenario s = accepted(kFull, overrides);
  const Scenario again = accepted(s.toml);
  EXPECT_EQ(again.id, s.id) << s.toml;
  EXPECT_NE(s.id, accepted(kFull).id);
  EXPECT_EQ(again.seed, 9223372036854775807u);
}

TEST(Overrides, AnErrorAroundAChangedValueRepeatsItAsItIsNow) {
  const ScenarioError error = only_error(kFull, {"mass.0.motion.0.acceleration=[5.5, 1]"});
  EXPECT_EQ(error.key, "mass.0.motion.0");
  EXPECT_TRUE(contains(error.value, "5.5")) << error.value;
  EXPECT_TRUE(contains(error.value, "duration")) << error.value;
}

}  // namespace
}  // namespace ballast::sim
