// Sweep files: what is read, and what is refused with which words.
#include <gtest/gtest.h>

#include "tests/sweep/sweeps.h"
#include "tools/sweep/row_scenario.h"

namespace ballast::sweep {
namespace {

using test::errors_of;
using test::spec_of;

TEST(Spec, ReadsTheContractsExample) {
  const Spec spec = spec_of(test::kPaperSweep);
  EXPECT_EQ(spec.rows(), 120u);
  ASSERT_EQ(spec.vary.size(), 3u);
  EXPECT_EQ(spec.vary[0].key, "mass.0.mass");  // in the order of the file
  EXPECT_EQ(spec.vary[2].key, "initial.angular_velocity.1");
  EXPECT_EQ(spec.keep.size(), 5u);
}

TEST(Spec, WrittenOutIsTheSameSweep) {
  for (const std::string& toml : {test::kPaperSweep, test::kStepperSweep}) {
    const Spec spec = spec_of(toml);
    std::string text = to_toml(spec);
    const std::string stored = "scenario = \"scenario.toml\"";
    text.replace(text.find(stored), stored.size(), "scenario = \"paper_ball\"");
    // The settings have gone into the scenario.
    text += "[set]\n" + toml.substr(toml.find("[set]") + 6, toml.find("[vary]") - toml.find("[set]") - 6);
    const Spec again = spec_of(text);
    EXPECT_EQ(to_toml(again), to_toml(spec));
    EXPECT_EQ(again.base_toml, spec.base_toml);
    EXPECT_EQ(identity(again), identity(spec));
  }
}

TEST(Spec, DottedKeysNeedNoQuotes) {
  const Spec quoted = spec_of(
      "scenario = \"paper_ball\"\nruns = 3\n[set]\n\"run.actuation\" = \"prescribed\"\n[vary]\n"
      "\"surface.static_friction\" = { uniform = [0.1, 0.5] }\n");
  const Spec bare = spec_of(
      "scenario = \"paper_ball\"\nruns = 3\n[set]\nrun.actuation = \"prescribed\"\n[vary]\n"
      "surface.static_friction = { uniform = [0.1, 0.5] }\n");
  EXPECT_EQ(identity(quoted), identity(bare));
}

struct Refusal {
  std::string rest;   // of the file, after the scenario
  std::string words;  // in the message
};

TEST(Spec, RefusesWithFileLineKeyAndWhatIsAllowed) {
  const Refusal refusals[] = {
      {"runs = 0\n[vary]\nduration = { uniform = [1, 2] }", "test.toml:2: runs = 0"},
      {"[vary]\nduration = { uniform = [1, 2] }", "runs: is missing"},
      {"runs = 5\nsede = 3\n", "test.toml:3: sede = 3: unknown key"},
      {"runs = 5\n[vary]\n\"surface.static_frction\" = { uniform = [0.1, 0.5] }", "did you mean static_friction"},
      {"runs = 5\n[vary]\n\"surface.static_friction\" = { unifrom = [0.1, 0.5] }", "did you mean uniform?"},
      {"runs = 5\n[vary]\n\"surface.static_friction\" = { grid = [] }",
       "test.toml:4: vary.surface.static_friction.grid = []: is empty"},
      {"runs = 5\n[vary]\n\"surface.static_friction\" = 0.3", "vary.surface.static_friction = 0.3: is no distribution"},
      {"runs = 5\n[vary]\n\"run.actuation\" = { uniform = [0, 1] }",
       "test.toml:4: vary.run.actuation = 'stepper': is a text in the scenario"},
      {"runs = 5\n[vary]\n\"run.actuation\" = { choice = [\"stepper\", 3] }", "mixes kinds of values"},
      {"runs = 5\n[vary]\n\"run.actuation\" = { choice = [\"steper\"] }",
       "test.toml:4: vary.run.actuation = \"steper\": is none"},
      {"runs = 5\n[vary]\n\"surface.static_friction\" = { grid = [0.3, nan] }", "has a value that is no number"},
      {"runs = 5\n[vary]\n\"initial.orientation\" = { grid = [[1, 0, 0, 0], [0, 1, 0]] }",
       "lists of different lengths"},
      {"runs = 5\n[set]\nduration = 2\n[vary]\nduration = { uniform = [1, 2] }",
       "test.toml:4: set.duration = 2: is varied too"},
      {"runs = 5\nname = \"../there\"", "test.toml:3: name = \"../there\": cannot name a folder"},
      {"runs = 5\n[vary]\nduration = { uniform = [2, 1] }", "has its ends in the wrong order"},
      {"runs = 5\n[vary]\nduration = { log_uniform = [0, 1] }", "has no logarithm"},
      {"runs = 5\n[vary]\nduration = { normal = [1, -1] }", "has a negative deviation"},
      {"runs = 5\n[vary]\nduration = { normal = [1] }", "is no pair of numbers"},
      {"runs = 5\n[vary]\nduration = { normal = [1, 1], uniform = [1, 2] }", "names more than one key"},
      {"runs = 5\n[vary]\nduration = { tilt = 0.1 }",
       "is no distribution of this key; allowed: of initial.orientation"},
      {"runs = 5\n[vary]\n\"initial.orientation\" = { tilt = -1 }", "is no angle"},
      {"runs = 5\n[vary]\nseed = { uniform = [1, 2] }", "every row has a seed of its own"},
      {"runs = 5\n[vary]\n\"mass.9.mass\" = { uniform = [1, 2] }", "mass has no entry \"9\"; allowed: 0 to 2"},
      {"runs = 5\n[set]\n\"surface.frction\" = 1", "test.toml:4: surface.frction = 1: unknown key"},
      {"runs = 5\n[keep]\nvalues = [\"mu_required.maks\"]", "did you mean mu_required.max?"},
      {"runs = 5\n[keep]\nvalues = [\"mu_required\"]", "is a table in summary.json"},
      {"runs = 5\n[keep]\nvalues = [\"motors\"]", "is a list of tables in summary.json"},
      {"runs = 5\n[keep]\nvalues = [\"wall_time\"]", "differs between identical runs"},
      {"runs = 5\n[keep]\nvalues = \"end.reason\"", "is no list"},
      {"runs = 10000000000\n[vary]\nduration = { grid = [1, 2] }", "makes too many runs with the grids"},
  };
  for (const Refusal& refusal : refusals) {
    const std::string errors = errors_of("scenario = \"paper_ball\"\n" + refusal.rest + "\n");
    EXPECT_NE(errors.find(refusal.words), std::string::npos) << refusal.rest << "\nsays: " << errors;
  }
  EXPECT_NE(errors_of("scenario = \"paper_bal\"\nruns = 1\n").find("did you mean paper_ball"), std::string::npos);
  EXPECT_NE(errors_of("runs = 1\n").find("scenario: is missing"), std::string::npos);
  EXPECT_EQ(errors_of("duration = 1\n[ball]\nmass = 1\n"),
            "test.toml: is a scenario; allowed: a sweep file, or a scenario with --errors\n");
  EXPECT_NE(errors_of("runs = = 1\n").find("test.toml:1: not TOML"), std::string::npos);
}

// --set lowers the kinetic friction with the static one; so does a sweep.
TEST(RowScenarios, TakeValuesAsSetDoes) {
  const Spec spec = spec_of(test::kPaperSweep);
  const RowScenarios rows(spec);
  for (std::uint64_t i = 0; i < spec.rows(); ++i) {
    const Row row = make_row(spec, i);
    const sim::ScenarioResult made = rows.make(row);
    ASSERT_TRUE(made.ok()) << sim::to_string(made.errors.front());
    EXPECT_EQ(made.scenario.masses[0].mass_kg, row.values[0].number);
    EXPECT_EQ(made.scenario.surface.static_friction, row.values[1].number);
    EXPECT_EQ(made.scenario.initial.angular_velocity_B_radps[1], row.values[2].number);
    EXPECT_EQ(made.scenario.seed, row.seed);
    const sim::ScenarioResult file = sim::parse_scenario(rows.toml(row), "row.toml");
    ASSERT_TRUE(file.ok()) << sim::to_string(file.errors.front());
    EXPECT_EQ(file.scenario.id, made.scenario.id);  // the same scenario to the bit
  }
}

}  // namespace
}  // namespace ballast::sweep
