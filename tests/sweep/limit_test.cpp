// --find-limit: the value of one key at which runs cease to hold.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/sweep/sweeps.h"
#include "tools/sweep/limit_search.h"
#include "tools/sweep/row_runner.h"

namespace ballast::sweep {
namespace {

const std::string kSearch = R"(
scenario = "paper_ball"
runs = 9
find_limit = "surface.static_friction"
[set]
"run.actuation" = "prescribed"
duration = 4.0
[vary]
"mass.0.mass" = { normal = [1.0, 0.05] }
"surface.static_friction" = { uniform = [0.1, 0.3] }
[keep]
values = ["mu_required.max"]
)";

std::vector<RowResult> results_of(const Spec& spec) {
  const RowScenarios scenarios(spec);
  std::vector<RowResult> results;
  RowRunner(spec, scenarios).run(0, spec.rows(), [&results](RowResult&& row) {
    results.push_back(std::move(row));
    return true;
  });
  return results;
}

// The least floor that holds a prescribed run is the friction that the run needs, whatever the floor. The bracket is a
// 65,536th of the range; 1e-6 is the accuracy of the extrema.
TEST(FindLimit, FindsTheFrictionThatARunNeeds) {
  const Spec spec = test::spec_of(kSearch);
  for (const RowResult& row : results_of(spec)) {
    EXPECT_TRUE(row.held());
    const double limit = std::get<double>(row.kept[1]), floor = std::get<double>(row.varied[1]);
    EXPECT_NEAR(limit, std::get<double>(row.kept[0]), 0.2 / 65536 + 1e-6);
    EXPECT_GT(floor, limit);
    EXPECT_NEAR(floor, limit, 0.2 / 65536);
    EXPECT_EQ(row.kept[2], Cell(std::string("holds above")));
  }
}

// The same sweep, the logarithm bisected; and one run at a time, because the radius is varied.
TEST(FindLimit, FindsTheSameByOtherWays) {
  std::string other = kSearch;
  other.replace(other.find("uniform"), 7, "log_uniform");
  std::string single = kSearch + "";
  single.replace(single.find("[keep]"), 6, "\"ball.radius\" = { choice = [1.0] }\n[keep]");
  const auto results = results_of(test::spec_of(kSearch)), logs = results_of(test::spec_of(other)),
             singles = results_of(test::spec_of(single));
  for (std::size_t i = 0; i < results.size(); ++i) {
    const double limit = std::get<double>(results[i].kept[1]);
    EXPECT_NEAR(std::get<double>(logs[i].kept[1]), limit, 0.2 / 65536 + 0.3 * std::log(3.0) / 65536);
    EXPECT_NEAR(std::get<double>(singles[i].kept[1]), limit, 0.2 / 65536);
  }
}

// Runs that hold by their mass alone: below 1, above 1, always, never, or not at all.
TEST(FindLimit, TellsWhatHolds) {
  Spec spec;
  spec.find_limit = "x";
  spec.vary.push_back({"x", Distribution::kUniform, 0, 2, {}, 0});
  Row row;
  row.values.push_back(number_node(0.5));
  int runs = 0;
  const auto search = [&](const std::function<int(double)>& status_of) {
    runs = 0;
    const RunRows run_rows = [&](const std::vector<Row>& rows) {
      std::vector<RowResult> results;
      for (const Row& of : rows) {
        ++runs;
        results.push_back({0, 0, status_of(of.values[0].number), {of.values[0].number}, {}});
      }
      return results;
    };
    return find_limits(spec, {row}, run_rows).front();
  };
  const RowResult below = search([](double x) { return x < 1.25 ? 0 : 3; });
  EXPECT_NEAR(std::get<double>(below.kept[0]), 1.25, 2.0 / 65536);
  EXPECT_EQ(below.kept[1], Cell(std::string("holds below")));
  EXPECT_LT(std::get<double>(below.varied[0]), 1.25);
  EXPECT_EQ(below.exit_status, 0);
  EXPECT_EQ(runs, 2 + kLimitHalvings);
  const RowResult above = search([](double x) { return x > 0.3 ? 0 : 3; });
  EXPECT_NEAR(std::get<double>(above.kept[0]), 0.3, 2.0 / 65536);
  EXPECT_EQ(above.kept[1], Cell(std::string("holds above")));
  const RowResult always = search([](double) { return 0; });
  EXPECT_EQ(always.kept, (std::vector<Cell>{Cell(), std::string("holds at both ends")}));
  EXPECT_EQ(runs, 2);
  const RowResult never = search([](double) { return 3; });
  EXPECT_EQ(never.kept, (std::vector<Cell>{Cell(), std::string("holds at no end")}));
  EXPECT_EQ(never.exit_status, 3);
  for (const RowResult& refused : {search([](double x) { return x > 1 ? 1 : 0; }), search([](double x) {
                                     return x > 1.9 ? 3 : x > 0.5 ? 1 : 0;
                                   })}) {
    EXPECT_EQ(refused.exit_status, 1);
    EXPECT_EQ(refused.kept, (std::vector<Cell>{Cell(), Cell()}));
  }
}

TEST(FindLimit, NeedsARange) {
  const std::string rest =
      "\nscenario = \"paper_ball\"\nruns = 9\n[vary]\n\"mass.0.mass\" = { normal = [1, 0.1] }\n"
      "\"mass.1.mass\" = { uniform = [1, 2] }\n\"mass.2.mass\" = { uniform = [1, 2] }\n";
  EXPECT_NE(test::errors_of("find_limit = \"duration\"" + rest).find("is not varied; allowed: a key of [vary] with"),
            std::string::npos);
  EXPECT_NE(test::errors_of("find_limit = \"mass.0.mass\"" + rest).find("is varied with normal; allowed: a key"),
            std::string::npos);
  EXPECT_NE(
      test::errors_of("find_limit = \"mass.1.mass\"\ncorrelation = [[\"mass.1.mass\", \"mass.2.mass\", 0.1]]" + rest)
          .find("is correlated with another key"),
      std::string::npos);
}

}  // namespace
}  // namespace ballast::sweep
