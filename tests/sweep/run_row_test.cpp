// Rows against full runs, and the names of kept values against summary.json.
#include "tools/sweep/run_row.h"

#include <gtest/gtest.h>

#include "tests/sweep/sweeps.h"
#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/sil/lap_sink.h"
#include "tools/summary/summary.h"
#include "tools/summary/summary_tree.h"
#include "tools/sweep/kept_values.h"

namespace ballast::sweep {
namespace {

using test::spec_of;

// A prescribed run tick by tick, with the monitor.
sil::RunResult full_run(const sim::Scenario& scenario) {
  const auto peers = sil::peers_in_process(scenario, nullptr, program::to_monitor_limits(scenario));
  sil::NoRecord nothing;
  return sil::run_with_faults(scenario, *peers, nothing, {});
}

// The rows leave out the ticks. What they keep must still be the full run's: extrema to 1e-6 as the contract says, here
// to the tolerance of the integrator times its usual growth over 4 s.
TEST(RunRow, AgreesWithTheFullRunOfPrescribedRows) {
  const Spec spec = spec_of(test::kPaperSweep);
  const RowScenarios scenarios(spec);
  int held = 0, slipped = 0;
  for (std::uint64_t i = 0; i < spec.rows(); ++i) {
    const RowResult row = run_row(spec, scenarios, make_row(spec, i));
    const sim::ScenarioResult read = scenarios.make(make_row(spec, i));
    ASSERT_TRUE(read.ok());
    const sil::RunResult full = full_run(read.scenario);
    const std::vector<Cell> kept = kept_values(spec.keep, read.scenario, full);
    EXPECT_EQ(row.exit_status, sil::exit_status(full)) << i;
    EXPECT_EQ(row.kept[4], kept[4]) << i;
    for (const std::size_t extremum : {0, 1}) {
      EXPECT_NEAR(std::get<double>(row.kept[extremum]), std::get<double>(kept[extremum]), 1e-8) << i;
    }
    for (std::size_t j = 0; j < 3; ++j) {
      EXPECT_NEAR(std::get<std::vector<double>>(row.kept[2])[j], std::get<std::vector<double>>(kept[2])[j], 1e-7) << i;
    }
    held += row.held();
    slipped += row.kept[4] == Cell(std::string("slipped"));
  }
  EXPECT_GT(held, 10);  // the sweep has rows of both kinds
  EXPECT_GT(slipped, 10);
}

TEST(RunRow, IsRepeatableWithSteppers) {
  const Spec spec = spec_of(test::kStepperSweep);
  const RowScenarios scenarios(spec);
  for (const std::uint64_t i : {0, 5}) {
    const RowResult once = run_row(spec, scenarios, make_row(spec, i)),
                    twice = run_row(spec, scenarios, make_row(spec, i));
    EXPECT_EQ(once.kept, twice.kept);
    EXPECT_EQ(once.exit_status, twice.exit_status);
    EXPECT_GT(std::get<double>(once.kept[2]), 0) << "no steps were made";
  }
}

TEST(RunRow, ThatTheCheckRefusesIsStatusOne) {
  const Spec spec = spec_of(
      "scenario = \"paper_ball\"\nruns = 20\n[set]\n\"run.actuation\" = \"prescribed\"\n[vary]\n"
      "\"mass.0.mass\" = { uniform = [-1.0, 1.0] }\n[keep]\nvalues = [\"end.time\"]\n");
  const RowScenarios scenarios(spec);
  int refused = 0;
  for (std::uint64_t i = 0; i < spec.rows(); ++i) {
    std::string why;
    const RowResult row = run_row(spec, scenarios, make_row(spec, i), &why);
    if (std::get<double>(row.varied[0]) > 0) continue;
    ++refused;
    EXPECT_EQ(row.exit_status, 1);
    EXPECT_EQ(row.kept[0], Cell());
    EXPECT_NE(why.find("test.toml:6: mass.0.mass = -"), std::string::npos) << why;
  }
  EXPECT_GT(refused, 0);
}

// The names that need no summary are those of the summary.
TEST(KeptValues, AreTheSummarys) {
  const Spec spec = spec_of(test::kPaperSweep);
  const sim::ScenarioResult read = RowScenarios(spec).make(make_row(spec, 50));
  const sil::RunResult result = full_run(read.scenario);
  const auto summary = sil::summary_tree(read.scenario, result);
  const std::vector<std::string> names{"end.reason",          "end.time",
                                       "mu_required.max",     "mu_required.time",
                                       "normal_force.min",    "normal_force.min_time",
                                       "normal_force.max",    "normal_force.max_time",
                                       "static_friction.max", "static_friction.time",
                                       "final.mass_position", "final.mass_velocity",
                                       "final.orientation",   "final.angular_velocity",
                                       "final.position",      "final.velocity",
                                       "travel.position",     "travel.speed",
                                       "travel.distance",     "surfaces.2.holds"};
  const std::vector<Cell> cells = kept_values(names, read.scenario, result);
  for (std::size_t i = 0; i < names.size(); ++i) {
    EXPECT_EQ(unknown_value(names[i]), "") << names[i];
    std::string pointer = "/" + names[i];
    std::replace(pointer.begin(), pointer.end(), '.', '/');
    const auto& value = summary.at(nlohmann::ordered_json::json_pointer(pointer));
    if (value.is_string())
      EXPECT_EQ(std::get<std::string>(cells[i]), value.get<std::string>());
    else if (value.is_array())
      EXPECT_EQ(std::get<std::vector<double>>(cells[i]), value.get<std::vector<double>>()) << names[i];
    else if (value.is_boolean())
      EXPECT_EQ(std::get<double>(cells[i]), value.get<bool>() ? 1 : 0);
    else
      EXPECT_EQ(std::get<double>(cells[i]), value.get<double>()) << names[i];
  }
}

// The coast is no value of the plant alone: a row that keeps it writes the whole summary.
TEST(KeptValues, HaveTheCoastWhereTheBallRollsOn) {
  const std::vector<std::string> names{"coast.energy", "coast.turns_over", "coast.distance", "coast.floors.0.name",
                                       "coast.floors.0.distance"};
  const auto kept = [&](const std::string& changes) {
    const Spec spec =
        spec_of("scenario = \"paper_ball\"\nruns = 1\n[set]\n\"run.actuation\" = \"prescribed\"\n" + changes +
                "[vary]\n\"mass.0.mass\" = { uniform = [0.99, 1.0] }\n[keep]\nvalues = [\"coast.energy\", "
                "\"coast.turns_over\", \"coast.distance\", \"coast.floors.0.name\", \"coast.floors.0.distance\"]\n");
    EXPECT_FALSE(decided_by_plant(spec.keep, false));
    const RowScenarios scenarios(spec);
    const RowResult row = run_row(spec, scenarios, make_row(spec, 0));
    const sim::ScenarioResult read = scenarios.make(make_row(spec, 0));
    const auto summary = sil::summary_tree(read.scenario, full_run(read.scenario));
    return std::pair(row.kept, summary.at("coast"));
  };
  for (const std::string& name : names) EXPECT_EQ(unknown_value(name), "") << name;
  EXPECT_NE(unknown_value("coast"), "");

  const auto [resisting, coast] = kept("\"surface.rolling_resistance\" = 0.01\n\"duration\" = 2.0\n");
  EXPECT_NEAR(std::get<double>(resisting[0]), coast.at("energy").get<double>(), 1e-8);
  EXPECT_EQ(std::get<double>(resisting[1]), coast.at("turns_over").get<bool>() ? 1 : 0);
  EXPECT_NEAR(std::get<double>(resisting[2]), coast.at("distance").get<double>(), 1e-6);
  EXPECT_EQ(std::get<std::string>(resisting[3]), coast.at("floors").at(0).at("name").get<std::string>());
  EXPECT_GT(std::get<double>(resisting[2]), 0);

  const auto [ideal, coast_on] = kept("\"duration\" = 2.0\n");
  EXPECT_TRUE(coast_on.at("distance").is_null());
  EXPECT_EQ(ideal[2], Cell());

  const auto [slope, none] = kept("\"surface.slope.angle\" = 0.01\n\"duration\" = 0.5\n");
  EXPECT_TRUE(none.is_null());
  for (const Cell& cell : slope) EXPECT_EQ(cell, Cell());
}

}  // namespace
}  // namespace ballast::sweep
