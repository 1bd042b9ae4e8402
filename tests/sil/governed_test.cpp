// Governed runs of the shipped scenarios. The bars are those of issue 22.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/sil/kept_laps.h"

namespace ballast::sil {
namespace {

sim::Scenario governed(const std::string& name, const std::vector<std::string>& more) {
  std::vector<std::string> overrides{"control.governor=true", "control.friction_use=1"};
  overrides.insert(overrides.end(), more.begin(), more.end());
  const auto read = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides);
  for (const auto& error : read.errors) ADD_FAILURE() << to_string(error);
  return read.scenario;
}

std::vector<std::string> floor(const char* static_friction, const char* actuation) {
  return {std::string("surface.static_friction=") + static_friction, "surface.kinetic_friction=0.1",
          std::string("run.actuation=\"") + actuation + "\""};
}

double bend(const RunResult& result) { return *std::ranges::max_element(result.governor->largest_bend); }

// The motion itself needs .1906. The floor of .13 does not even hold the motion's start, which the governor bends.
TEST(Governed, PaperBallRollsOnIdealMasses) {
  struct Case {
    const char* friction;
    double most_bend;
  };
  for (const Case& c : {Case{"0.17", 0.8}, Case{"0.16", 1.3}, Case{"0.13", 20}}) {
    const RunResult result = roll(governed("paper_ball", floor(c.friction, "ideal"))).result;
    EXPECT_EQ(result.end_reason, EndReason::kCompleted) << c.friction;
    EXPECT_EQ(result.trip.tripped, 0) << c.friction;
    ASSERT_TRUE(result.governor);
    EXPECT_LE(bend(result), c.most_bend) << c.friction;
    EXPECT_GT(result.governor->bent_ticks, 0) << c.friction;
  }
}

// With the shipped motors the first 10 s, in which it slipped before certificates knew of the swing.
TEST(Governed, PaperBallRollsOnItsSteppers) {
  for (const char* friction : {"0.17", "0.15"}) {
    std::vector<std::string> overrides = floor(friction, "stepper");
    overrides.emplace_back("duration=10");
    const RunResult result = roll(governed("paper_ball", overrides)).result;
    EXPECT_EQ(result.end_reason, EndReason::kCompleted) << friction;
    EXPECT_EQ(result.trip.tripped, 0) << friction;
  }
}

TEST(Governed, LeavesSafeMotionsAlone) {
  for (const char* name : {"paper_ball", "desk_ball"}) {
    for (const char* actuation : {"ideal", "stepper"}) {
      const std::string run = std::string("run.actuation=\"") + actuation + "\"";
      const RunResult result = roll(governed(name, {run, "duration=8"})).result;
      EXPECT_EQ(result.end_reason, EndReason::kCompleted) << name;
      ASSERT_TRUE(result.governor);
      EXPECT_EQ(result.governor->bent_ticks, 0) << name << ", " << actuation;
      EXPECT_GT(result.governor->ticks, 7000);
    }
  }
}

}  // namespace
}  // namespace ballast::sil
