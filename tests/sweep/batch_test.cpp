// Balls rolled in vector registers: the same bits everywhere, the order of the method, and the plant's results.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

#include "tests/sweep/sweeps.h"
#include "tools/sweep/batch_rows.h"

namespace ballast::sweep {
namespace {

std::vector<Lanes> available_lanes() {
  std::vector<Lanes> all{Lanes::kPortable};
  if (best_lanes() != Lanes::kPortable) all.push_back(Lanes::kAvx2);
  if (best_lanes() == Lanes::kAvx512) all.push_back(Lanes::kAvx512);
  return all;
}

sim::Scenario paper_scenario() {
  const Spec spec = test::spec_of(test::kPaperSweep);
  return RowScenarios(spec).make(make_row(spec, 0)).scenario;
}

// Eight different balls.
std::array<BatchBall, kLanes> some_balls(const sim::Scenario& scenario) {
  std::array<BatchBall, kLanes> balls;
  for (std::size_t l = 0; l < kLanes; ++l) {
    const double part = static_cast<double>(l) / kLanes;
    BatchBall& ball = balls[l];
    ball.shell_mass_kg = 1 + 0.1 * part;
    ball.inertia_kgm2 = {0.9 + 0.05 * part, 1.0, 1.1};
    ball.center_of_mass_B_m = {0.01 * part, 0, -0.05};
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) ball.mass_kg[i] = 1 - 0.02 * part;
    ball.force_W_n = {0.01 * part, -0.02 * part, 0.03 * part};
    ball.angular_velocity_B_radps = {0.1 * part, -0.05, 0.02};
  }
  return balls;
}

std::array<BatchResult, kLanes> rolled(const MotionTable& table, const std::array<BatchBall, kLanes>& balls,
                                       Lanes lanes) {
  std::array<BatchResult, kLanes> results;
  RollingBatch(table, lanes).roll(balls, results);
  return results;
}

bool same_bits(const BatchResult& a, const BatchResult& b) {
  using Bits = std::array<std::uint64_t, sizeof(BatchResult) / sizeof(double)>;
  return std::bit_cast<Bits>(a) == std::bit_cast<Bits>(b);
}

TEST(RollingBatch, HasTheSameBitsInAnyWidth) {
  const sim::Scenario scenario = paper_scenario();
  const MotionTable table(scenario, 0.02);
  const auto balls = some_balls(scenario);
  const auto first = rolled(table, balls, Lanes::kPortable);
  for (const Lanes lanes : available_lanes()) {
    const auto other = rolled(table, balls, lanes);
    for (std::size_t l = 0; l < kLanes; ++l)
      EXPECT_TRUE(same_bits(first[l], other[l])) << static_cast<int>(lanes) << " " << l;
  }
}

TEST(RollingBatch, KeepsItsLanesApart) {
  const sim::Scenario scenario = paper_scenario();
  const MotionTable table(scenario, 0.02);
  auto balls = some_balls(scenario);
  const auto first = rolled(table, balls, best_lanes());
  std::swap(balls[0], balls[5]);
  balls[3].angular_velocity_B_radps = {NAN, 1e30, 0};
  const auto other = rolled(table, balls, best_lanes());
  EXPECT_TRUE(same_bits(first[0], other[5]));
  EXPECT_TRUE(same_bits(first[5], other[0]));
  EXPECT_TRUE(same_bits(first[7], other[7]));
}

// A quarter of the step has 4^4 = 256 times less error at order 4; 60 allows for the terms of higher order.
TEST(RollingBatch, HasOrderFour) {
  sim::Scenario scenario = paper_scenario();
  scenario.duration_s = 12;
  const auto balls = some_balls(scenario);
  const auto at = [&](double step) { return rolled(MotionTable(scenario, step), balls, best_lanes())[7]; };
  const BatchResult coarse = at(0.16), fine = at(0.04), exact = at(0.0025);
  const auto error = [&](const BatchResult& r) {
    double sum = 0;
    for (std::size_t i = 0; i < 4; ++i) sum += std::pow(r.orientation[i] - exact.orientation[i], 2);
    for (std::size_t i = 0; i < 2; ++i) sum += std::pow(r.position_W_m[i] - exact.position_W_m[i], 2);
    return std::sqrt(sum);
  };
  EXPECT_GT(error(coarse), 60 * error(fine)) << error(coarse) << " " << error(fine);
  const double mu = at(0.02).mu_required_max.value;
  EXPECT_NEAR(mu, exact.mu_required_max.value, 1e-6 * mu);
}

std::vector<Row> rows_of(const Spec& spec, std::uint64_t first, std::uint64_t count) {
  std::vector<Row> rows;
  for (std::uint64_t i = first; i < first + count; ++i) rows.push_back(make_row(spec, i));
  return rows;
}

// All rows against the plant's: what rolls to 1e-6 (the contract's bound), what slips to the bit.
TEST(BatchRows, AreThePlantsRows) {
  const Spec spec = test::spec_of(test::kPaperSweep);
  const RowScenarios scenarios(spec);
  BatchRows batch(spec, scenarios);
  ASSERT_TRUE(batch.usable());
  std::uint64_t number = 0;
  int slipped = 0;
  for (const RowResult& row : batch.run(rows_of(spec, 0, spec.rows()))) {
    const RowResult plant = run_row(spec, scenarios, make_row(spec, number));
    EXPECT_EQ(row.number, number);
    EXPECT_EQ(row.seed, plant.seed);
    EXPECT_EQ(row.varied, plant.varied);
    EXPECT_EQ(row.exit_status, plant.exit_status);
    EXPECT_EQ(row.kept[4], plant.kept[4]);
    if (plant.kept[4] != Cell(std::string("completed"))) {
      ++slipped;
      EXPECT_EQ(row.kept, plant.kept);
    }
    for (const std::size_t i : {0, 1}) {
      const double truth = std::get<double>(plant.kept[i]);
      EXPECT_NEAR(std::get<double>(row.kept[i]), truth, 1e-6 * truth) << number;
    }
    for (std::size_t j = 0; j < 3; ++j) {
      EXPECT_NEAR(std::get<std::vector<double>>(row.kept[2])[j], std::get<std::vector<double>>(plant.kept[2])[j], 1e-6);
    }
    ++number;
  }
  EXPECT_EQ(number, spec.rows());
  EXPECT_GT(slipped, 10);
}

// One row of 300 turns 40 times as fast as those that the step is chosen from: the batch leaves it to the plant.
TEST(BatchRows, LeaveRowsThatAreIntegratedWorseToThePlant) {
  Spec spec = test::spec_of(
      "scenario = \"paper_ball\"\nruns = 300\n[set]\n\"run.actuation\" = \"prescribed\"\nduration = 4.0\n"
      "\"surface.static_friction\" = 1000.0\n[vary]\n\"initial.angular_velocity.2\" = { normal = [0.0, 0.5] }\n"
      "[keep]\nvalues = [\"mu_required.max\", \"normal_force.min\"]\n");
  const RowScenarios scenarios(spec);
  BatchRows batch(spec, scenarios);
  ASSERT_TRUE(batch.usable());
  std::vector<Row> rows = rows_of(spec, 0, 8);
  rows[3].values[0] = number_node(20.0);
  const std::vector<RowResult> results = batch.run(rows);
  const RowResult plant = run_row(spec, scenarios, rows[3]);
  EXPECT_EQ(results[3].kept, plant.kept);  // to the bit
  EXPECT_NE(results[2].kept, run_row(spec, scenarios, rows[2]).kept);
}

TEST(BatchRows, AreTheSameWhereverTheyBegin) {
  const Spec spec = test::spec_of(test::kPaperSweep);
  const RowScenarios scenarios(spec);
  std::vector<RowResult> whole, parts;
  for (const Lanes lanes : available_lanes()) {
    BatchRows batch(spec, scenarios, lanes);
    std::vector<RowResult>& rows = lanes == Lanes::kPortable ? whole : parts;
    rows.clear();
    if (lanes == Lanes::kPortable) {
      rows = batch.run(rows_of(spec, 0, 40));
      continue;
    }
    for (const auto& [first, count] : {std::pair{0u, 3u}, {3u, 9u}, {12u, 28u}}) {
      const std::vector<RowResult> part = batch.run(rows_of(spec, first, count));
      rows.insert(rows.end(), part.begin(), part.end());
    }
    ASSERT_EQ(whole.size(), parts.size());
    for (std::size_t i = 0; i < whole.size(); ++i) EXPECT_EQ(whole[i].kept, parts[i].kept) << i;
  }
}

TEST(BatchRows, LeaveOtherSweepsAlone) {
  for (const std::string vary :
       {"\"mass.0.initial_position\" = { uniform = [0, 1] }", "\"ball.radius\" = { uniform = [1, 2] }",
        "\"run.actuation\" = { choice = [\"stepper\", \"prescribed\"] }"}) {
    const std::string set = vary.starts_with("\"run.") ? "" : "[set]\n\"run.actuation\" = \"prescribed\"\n";
    const Spec spec = test::spec_of("scenario = \"paper_ball\"\nruns = 3\n" + set + "[vary]\n" + vary + "\n");
    const RowScenarios scenarios(spec);
    EXPECT_FALSE(BatchRows(spec, scenarios).usable()) << vary;
  }
  // A quantity that the first rows do not need must not be missing in the others.
  for (const std::string floor : {"rolling_resistance\" = 0.01", "spin_friction\" = 0.01", "slope.angle\" = 0.1"}) {
    const Spec spec =
        test::spec_of("scenario = \"paper_ball\"\nruns = 3\n[set]\n\"run.actuation\" = \"prescribed\"\n\"surface." +
                      floor + "\n[vary]\n\"initial.angular_velocity.2\" = { grid = [0, 5] }\n");
    const RowScenarios scenarios(spec);
    EXPECT_FALSE(BatchRows(spec, scenarios).usable()) << floor;
  }
  const Spec stepper = test::spec_of(test::kStepperSweep);
  const RowScenarios scenarios(stepper);
  EXPECT_FALSE(BatchRows(stepper, scenarios).usable());
}

}  // namespace
}  // namespace ballast::sweep
