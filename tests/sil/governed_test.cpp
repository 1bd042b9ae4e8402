// Governed runs of the shipped scenarios.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/sil/kept_laps.h"
#include "tests/sil/shell.h"

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
  // Largest bends, rad: .80, 1.13 and 2.47. They are chaotic: variants of details give up to 1.1, 1.7 and 3.3.
  for (const Case& c : {Case{"0.17", 1.1}, Case{"0.16", 1.7}, Case{"0.13", 3.3}}) {
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
    ASSERT_TRUE(result.governor);
    EXPECT_GT(result.governor->bent_ticks, 0) << friction;
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

// Declared errors of the belief cost a hanging ball nothing; one on its head is bent for small ones and refused for
// great ones, with the words of any start that no stop is certified for.
TEST(Governed, KeepsFreeWhatIsDeclared) {
  const std::vector<std::string> desk{"run.actuation=\"ideal\"", "duration=8", "control.belief_error.mass=0.05",
                                      "control.belief_error.center_of_mass=0.00075"};
  const RunResult hanging = roll(governed("desk_ball", desk)).result;
  EXPECT_EQ(hanging.end_reason, EndReason::kCompleted);
  ASSERT_TRUE(hanging.governor);
  EXPECT_EQ(hanging.governor->bent_ticks, 0);
  const test::Folder folder;
  // The figures of tools/docs/governor.md.
  const std::string head =
      "ballast run paper_ball --actuation ideal --set control.governor=true --set control.belief_error.mass=";
  EXPECT_SAYS(folder.run(head + "0.01").out, "bent the commands of 5.56 % of its ticks");
  EXPECT_SAYS(folder.run(head + "0.02").out, "bent the commands of 28.4 % of its ticks");
  const auto refused = folder.run(head + "0.05");
  EXPECT_EQ(refused.exit_status, 1);
  EXPECT_SAYS(refused.err, "the controller refuses the start: no stop can be certified");
}

// A motion that begins late starts from where its masses stand, without its initial velocity; a halt follows none.
TEST(GovernorWatch, ComparesWithTheMotionAsItBegan) {
  sim::Scenario scenario = governed("paper_ball", {});
  ASSERT_FALSE(scenario.masses.empty());
  scenario.masses[0].initial_velocity = 0.05;
  firmware::Profile motion;
  std::vector<firmware::ProfilePiece> pieces;
  for (const sim::MotionPiece& piece : scenario.masses[0].motion) {
    pieces.push_back({piece.duration_s, piece.acceleration_start, piece.acceleration_end});
  }
  ASSERT_TRUE(motion.set(0, 0, pieces.data(), static_cast<int>(pieces.size())));
  GovernorWatch watch(scenario);
  controller_status_t status{};
  status.mode = controller_status_t::MODE_ARMED;
  watch.observe(status);
  EXPECT_EQ(watch.record().ticks, 0);
  status.governed = 1;
  status.mode = controller_status_t::MODE_RUNNING;
  for (std::size_t i = 1; i < scenario.masses.size(); ++i)
    status.next_position[i] = scenario.masses[i].initial_position;
  const double from = 0.7, bend = 0.01;
  for (int k = 0; k < 1000; ++k) {
    status.tick = 5000 + k;
    const auto point = motion.at(k * scenario.run.control_period_s);
    status.next_position[0] = from + point.position + (k == 500 ? bend : 0);
    status.next_velocity[0] = point.velocity;
    watch.observe(status);
  }
  EXPECT_EQ(watch.record().ticks, 1000);
  EXPECT_NEAR(watch.record().largest_bend[0], bend, 1e-12);
  status.mode = controller_status_t::MODE_HALTING;
  status.next_position[0] = 100;
  watch.observe(status);
  EXPECT_EQ(watch.record().ticks, 1000);
  EXPECT_NEAR(watch.record().largest_bend[0], bend, 1e-12);
}

// The lines that a person reads.
TEST(GovernedText, SaysWhatWasBentAndWhatWasKept) {
  const test::Folder folder;
  const std::string governed = " --set control.governor=true --set duration=1";
  EXPECT_SAYS(folder.run("ballast run paper_ball --actuation ideal" + governed).out,
              "governor    on: bent no command; in all its ticks a stop was certified, with a margin of 0.");
  const std::string bent = folder
                               .run(
                                   "ballast run paper_ball --set control.friction_use=1 --set control.governor=true "
                                   "--set surface.static_friction=0.17 --set surface.kinetic_friction=0.1 "
                                   "--set duration=4")
                               .out;
  EXPECT_SAYS(bent, "governor    on: bent the commands of ");
  EXPECT_SAYS(bent, " % of N free for motors, estimate and belief");
  EXPECT_EQ(folder.run("ballast move desk_ball --mass 0 --to 0.1" + governed).out.find("governor"), std::string::npos);
  EXPECT_SAYS(folder
                  .run("ballast run paper_ball --set surface.static_friction=0.05 --set surface.kinetic_friction=0.05" +
                       governed)
                  .err,
              " % more friction than the governor may use");
  // The need is the motion's, whether it is governed or not.
  const std::string need = "ballast friction paper_ball --actuation ideal --set duration=1";
  EXPECT_EQ(folder.run(need + " --set control.governor=true --set surface.static_friction=0.16").out.substr(0, 60),
            folder.run(need).out.substr(0, 60));
}

}  // namespace
}  // namespace ballast::sil
