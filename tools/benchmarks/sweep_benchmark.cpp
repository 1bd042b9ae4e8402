// Prescribed sweeps of the paper's ball to T = 20 with h = 0.02, eight runs at a time, beside the yardstick of
// batch_limit.h. The counter is the time per Runge-Kutta step and ball.
#include <benchmark/benchmark.h>

#include <cmath>

#include "tools/benchmarks/batch_limit.h"
#include "tools/benchmarks/scenario.h"
#include "tools/sweep/block.h"
#include "tools/sweep/read_spec.h"
#include "tools/sweep/row_runner.h"

namespace ballast::benchmarks {
namespace {

constexpr double kStep = 0.02;

constexpr const char* kSweep = R"(
scenario = "paper_ball"
runs = 1000000
seed = 1
[set]
"run.actuation" = "prescribed"
duration = 20.0
"surface.static_friction" = 10.0
[vary]
"mass.0.mass" = { normal = [1.0, 0.05] }
"mass.1.mass" = { normal = [1.0, 0.05] }
"initial.angular_velocity.1" = { normal = [0.0, 0.1] }
[keep]
values = ["end.reason", "mu_required.max", "normal_force.min", "static_friction.max"]
)";

std::array<sweep::BatchBall, sweep::kLanes> balls_of(const sim::Scenario& scenario) {
  std::array<sweep::BatchBall, sweep::kLanes> balls;
  for (std::size_t l = 0; l < sweep::kLanes; ++l) {
    sweep::BatchBall& ball = balls[l];
    ball.shell_mass_kg = scenario.ball.mass_kg;
    for (std::size_t j = 0; j < 3; ++j) {
      ball.inertia_kgm2[j] = scenario.ball.inertia_kgm2[static_cast<int>(j)];
      ball.center_of_mass_B_m[j] = scenario.ball.center_of_mass_B_m[static_cast<int>(j)];
    }
    for (std::size_t i = 0; i < scenario.masses.size(); ++i)
      ball.mass_kg[i] = scenario.masses[i].mass_kg * (1 + 0.01 * static_cast<double>(l));
  }
  return balls;
}

void count_steps(benchmark::State& state, const sweep::MotionTable& table) {
  state.counters["per_step_and_ball"] =
      benchmark::Counter(static_cast<double>(table.total_steps() * sweep::kLanes),
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void BatchLimit(benchmark::State& state) {
  if (!batch_limit_runs()) return state.SkipWithError("the yardstick needs AVX-512");
  const sim::Scenario scenario = paper_ball("prescribed");
  const sweep::MotionTable table(scenario, kStep);
  const auto balls = balls_of(scenario);
  BatchAttitudes q{};
  for (auto _ : state) benchmark::DoNotOptimize(q = roll_batch_limit(table, balls));
  std::array<sweep::BatchResult, sweep::kLanes> rolled;
  sweep::RollingBatch(table).roll(balls, rolled);
  // Both are RK4 with the same steps, so that they differ by rounding, which twenty seconds enlarge.
  for (std::size_t l = 0; l < sweep::kLanes; ++l) {
    for (std::size_t j = 0; j < 4; ++j) {
      if (std::abs(q[j][l] - rolled[l].orientation[j]) > 1e-6) state.SkipWithError("the yardstick rolls another ball");
    }
  }
  count_steps(state, table);
}
BENCHMARK(BatchLimit)->Unit(benchmark::kMicrosecond);

void BatchRoll(benchmark::State& state, sweep::Lanes lanes) {
  if (static_cast<int>(lanes) > static_cast<int>(sweep::best_lanes()))
    return state.SkipWithError("not on this processor");
  const sim::Scenario scenario = paper_ball("prescribed");
  const sweep::MotionTable table(scenario, kStep);
  const auto balls = balls_of(scenario);
  sweep::RollingBatch batch(table, lanes);
  std::array<sweep::BatchResult, sweep::kLanes> rolled;
  for (auto _ : state) {
    batch.roll(balls, rolled);
    benchmark::DoNotOptimize(rolled);
  }
  count_steps(state, table);
}
BENCHMARK_CAPTURE(BatchRoll, avx512, sweep::Lanes::kAvx512)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(BatchRoll, avx2, sweep::Lanes::kAvx2)->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(BatchRoll, portable, sweep::Lanes::kPortable)->Unit(benchmark::kMicrosecond);

// The largest relative difference of 64 rows' extrema from those that the plant locates.
double largest_error(const sweep::Spec& spec, const sweep::RowScenarios& scenarios, sweep::RowRunner& runner) {
  double largest = 0;
  runner.run(0, 64, [&](const sweep::RowResult& row) {
    const sweep::RowResult plant = sweep::run_row(spec, scenarios, sweep::make_row(spec, row.number));
    for (std::size_t i = 1; i < row.kept.size(); ++i) {
      const double truth = std::get<double>(plant.kept[i]);
      largest = std::max(largest, std::abs(std::get<double>(row.kept[i]) / truth - 1));
    }
    return true;
  });
  return largest;
}

// Eight rows as a sweep makes them: values, kernel, extrema, results, and the block that is written.
void SweepRows(benchmark::State& state) {
  std::vector<sim::ScenarioError> errors;
  const auto spec = sweep::parse_spec(kSweep, "benchmark", ".", errors);
  if (!spec) return state.SkipWithError(sim::to_string(errors.front()).c_str());
  const sweep::RowScenarios scenarios(*spec);
  sweep::RowRunner runner(*spec, scenarios);
  std::uint64_t row = 0;
  for (auto _ : state) {
    sweep::Block block;
    runner.run(row, sweep::kLanes, [&block](sweep::RowResult&& result) {
      block.rows.push_back(std::move(result));
      return true;
    });
    benchmark::DoNotOptimize(sweep::encoded(block));
    row = (row + sweep::kLanes) % 800000;
  }
  const sim::Scenario scenario = scenarios.make(sweep::make_row(*spec, 0)).scenario;
  count_steps(state, sweep::MotionTable(scenario, runner.step_s()));
  state.counters["step"] = runner.step_s();
  state.counters["largest_error"] = largest_error(*spec, scenarios, runner);
}
BENCHMARK(SweepRows)->Unit(benchmark::kMicrosecond);

// One row of a sweep with controller, steppers and monitor, beside WholeRunPerTick/stepper, which has a log.
void SweptRunPerTick(benchmark::State& state) {
  std::vector<sim::ScenarioError> errors;
  const auto spec = sweep::parse_spec("scenario = \"paper_ball\"\nruns = 1\n", "benchmark", ".", errors);
  if (!spec) return state.SkipWithError(sim::to_string(errors.front()).c_str());
  const sweep::RowScenarios scenarios(*spec);
  const sweep::Row row = sweep::make_row(*spec, 0);
  const sim::Scenario scenario = scenarios.make(row).scenario;
  for (auto _ : state) {
    if (sweep::run_row(*spec, scenarios, row).exit_status != 0) return state.SkipWithError("the run does not hold");
  }
  state.counters["per_tick"] =
      benchmark::Counter(scenario.duration_s / scenario.run.control_period_s,
                         benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(SweptRunPerTick)->Unit(benchmark::kMillisecond)->Apply(as_many_calls_as_asked);

}  // namespace
}  // namespace ballast::benchmarks
