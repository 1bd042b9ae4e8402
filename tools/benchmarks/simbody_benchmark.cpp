// The paper's ball to T = 20 in Simbody, an independent multibody program (tests/simbody).
#include <benchmark/benchmark.h>

#include <cmath>

#include "tests/data/reference.h"
#include "tests/simbody/robot_of.h"
#include "tools/benchmarks/scenario.h"

namespace ballast::benchmarks {
namespace {

// At the accuracy that ends within about 3e-7: the nearest to LimitIntegration/1e-8 among powers of ten. Building the
// model is not counted.
void SimbodyIntegration(benchmark::State& state) {
  peer::SimbodyBall ball(peer::robot_of(paper_ball("prescribed")), 1e-8);
  const auto start = ball.snapshot();
  for (auto _ : state) {
    ball.restore(*start);
    ball.advance(20);
  }
  const auto z = ball.sample().position_W_m;
  const auto end = test::reference_rows("paper_ball").back();
  const double error = std::hypot(z[0] - end.at("z_1"), z[1] - end.at("z_2"));
  state.counters["position_error"] = error;
  if (!(error < 1e-6)) state.SkipWithError("the ball does not end where the reference does");
}
BENCHMARK(SimbodyIntegration)->Unit(benchmark::kMicrosecond)->Apply(as_many_calls_as_asked);

}  // namespace
}  // namespace ballast::benchmarks
