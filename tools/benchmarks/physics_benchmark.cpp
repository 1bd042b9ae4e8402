// The cost of the paper's ball with prescribed masses: one right-hand side, and the run to T = 20 with the error it
// ends with, beside the yardstick (limit.h). tools/benchmarks/figures ratios prints them as a table.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>

#include "sim/plant/newton_euler.h"
#include "sim/plant/plant.h"
#include "tests/data/reference.h"
#include "tools/benchmarks/limit.h"
#include "tools/benchmarks/scenario.h"
#include "tools/integrators/rolling_run.h"

namespace ballast::benchmarks {
namespace {

constexpr double kEnd_s = 20;

// The plant's equations with N and f_s, with the rails but without the motion on them, which the plant finds elsewhere.
void RightHandSide(benchmark::State& state) {
  const auto s = paper_ball("prescribed");
  const sim::Body body(s);
  const double q[4] = {1, 0, 0, 0}, omega[3] = {0.1, 0.2, -0.3};
  double theta[3] = {0.1, 2.0, 0.7};
  double rate[3] = {0.15, 0.15, 0.15}, acceleration[3] = {1, 1, 1};
  sim::CarriedMasses masses;
  sim::MotionOf<double> motion;
  for (auto _ : state) {
    benchmark::DoNotOptimize(theta);
    benchmark::DoNotOptimize(rate);
    benchmark::DoNotOptimize(acceleration);
    sim::carry_along(body, theta, rate, acceleration, masses);
    sim::rolling_prescribed(body, 0, q, omega, masses, motion);
    benchmark::DoNotOptimize(motion);
  }
}
BENCHMARK(RightHandSide)->Apply(as_many_calls_as_asked);

// The yardstick's, everything in it: motion of the masses, N and f_s, the rates of quaternion and position. It must
// give the reference's forces at the reference's states.
void LimitRightHandSide(benchmark::State& state) {
  const LimitBall ball(paper_ball("prescribed"));
  const std::size_t last_piece = ball.piece_count() - 1;
  LimitBall::State y, dydt;
  double force_error = 0;
  for (const auto& row : test::reference_rows("paper_ball")) {
    if (row.at("t") < ball.piece_start_s(last_piece)) continue;
    y = {row.at("q_w"),     row.at("q_x"),     row.at("q_y"), row.at("q_z"), row.at("Omega_1"),
         row.at("Omega_2"), row.at("Omega_3"), row.at("z_1"), row.at("z_2")};
    const auto forces = ball.derivative(last_piece, row.at("t"), y.data(), dydt.data());
    force_error = std::max({force_error, std::abs(forces.normal_n - row.at("N")),
                            std::abs(forces.static_friction_n - std::hypot(row.at("f_1"), row.at("f_2")))});
  }
  state.counters["force_error"] = force_error;
  if (!(force_error < 1e-12)) state.SkipWithError("the forces are not the reference's, to rounding");

  for (auto _ : state) {
    benchmark::DoNotOptimize(y);
    auto forces = ball.derivative(last_piece, 20, y.data(), dydt.data());
    benchmark::DoNotOptimize(forces);
    benchmark::DoNotOptimize(dydt);
  }
}
BENCHMARK(LimitRightHandSide)->Apply(as_many_calls_as_asked);

void report_position(benchmark::State& state, double z1, double z2, double allowed) {
  const auto end = test::reference_rows("paper_ball").back();
  const double error = std::hypot(z1 - end.at("z_1"), z2 - end.at("z_2"));
  state.counters["position_error"] = error;
  if (!(error < allowed)) state.SkipWithError("the ball does not end where the reference does");
}

// The yardstick. `allowed` is ten times the position error that DOP853 leaves at that tolerance.
void LimitIntegration(benchmark::State& state, double tolerance, double allowed) {
  const LimitBall ball(paper_ball("prescribed"));
  LimitBall::State y{};
  std::int64_t evaluations = 0;
  for (auto _ : state) {
    evaluations = ball.integrate(kEnd_s, tolerance, y);
    benchmark::DoNotOptimize(y);
  }
  state.counters["right_hand_sides"] = static_cast<double>(evaluations);
  report_position(state, y[7], y[8], allowed);
}
BENCHMARK_CAPTURE(LimitIntegration, 1e-8, 1e-8, 1e-6)->Unit(benchmark::kMicrosecond)->Apply(as_many_calls_as_asked);
BENCHMARK_CAPTURE(LimitIntegration, 1e-10, 1e-10, 1e-8)->Unit(benchmark::kMicrosecond)->Apply(as_many_calls_as_asked);
BENCHMARK_CAPTURE(LimitIntegration, 1e-12, 1e-12, 1e-9)->Unit(benchmark::kMicrosecond)->Apply(as_many_calls_as_asked);

// `ballast integrate`, the integration alone: the same method on the plant's equations of motion, for any robot.
void Dop853Integration(benchmark::State& state, double tolerance, double allowed) {
  const auto scenario = paper_ball("prescribed");
  integrators::Settings settings;
  settings.tolerance = tolerance;
  integrators::BareRun run;
  for (auto _ : state) {
    run = integrators::integrate_only(scenario, *integrators::find_method("dop853"), settings, kEnd_s);
    benchmark::DoNotOptimize(run);
  }
  state.counters["right_hand_sides"] = static_cast<double>(run.counters.right_hand_sides);
  report_position(state, run.end_state[7], run.end_state[8], allowed);
}
BENCHMARK_CAPTURE(Dop853Integration, 1e-8, 1e-8, 1e-6)->Unit(benchmark::kMicrosecond)->Apply(as_many_calls_as_asked);
BENCHMARK_CAPTURE(Dop853Integration, 1e-10, 1e-10, 1e-8)->Unit(benchmark::kMicrosecond)->Apply(as_many_calls_as_asked);

// The plant in one call, with all it does besides: extrema, the envelope watched, torques.
void PlantIntegration(benchmark::State& state) {
  const sim::Plant start(paper_ball("prescribed"));
  sim::Plant plant = start;
  for (auto _ : state) {
    plant = start;
    plant.advance(kEnd_s, {});
  }
  const auto end = plant.sample();
  report_position(state, end.position_W_m[0], end.position_W_m[1], 1e-9);
}
BENCHMARK(PlantIntegration)->Unit(benchmark::kMicrosecond)->Apply(as_many_calls_as_asked);

}  // namespace
}  // namespace ballast::benchmarks
