// The cost of the step generator: a tick of one motor, at N microsteps per tick. Divide by N for the cost of a step.
#include <benchmark/benchmark.h>

#include <array>
#include <memory>
#include <stdexcept>

#include "firmware/motion/step_generator.h"
#include "tools/benchmarks/scenario.h"

namespace ballast::benchmarks {
namespace {

constexpr firmware::StepTiming kTiming{1e7, 1e-3, 2e-6};

void run(benchmark::State& state, const firmware::Profile& profile, double microsteps_per_unit) {
  firmware::StepCommand command;
  std::int64_t pulses = 0;
  for (auto _ : state) {
    command.burst_count = 0;
    command.steps = {};
    const double t0_s = static_cast<double>(command.tick) * kTiming.control_period_s;
    const firmware::StepError error =
        firmware::generate_steps(profile, t0_s, 0, microsteps_per_unit, 62000, kTiming, 0, command);
    if (error != firmware::StepError::kNone) {
      state.SkipWithError("not stepped");
      return;
    }
    pulses += command.steps[0] < 0 ? -command.steps[0] : command.steps[0];
    ++command.tick;
  }
  state.counters["steps_per_tick"] = static_cast<double>(pulses) / static_cast<double>(state.iterations());
}

// Constant speed of state.range(0) microsteps per tick.
void StepTickConstant(benchmark::State& state) {
  auto profile = std::make_unique<firmware::Profile>();
  if (!profile->set(0, 1, nullptr, 0)) throw std::runtime_error("no profile");
  run(state, *profile, static_cast<double>(state.range(0)) * 1000);
}
BENCHMARK(StepTickConstant)->Apply(as_many_calls_as_asked)->Arg(0)->Arg(1)->Arg(5)->Arg(20)->Arg(60);

// To and fro in S-curves of 1 s, 20 microsteps per tick in the mean of |speed| over whole strokes; 64 strokes.
void StepTickSCurve(benchmark::State& state) {
  auto profile = std::make_unique<firmware::Profile>();
  std::array<firmware::ProfilePiece, 128> pieces;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const double a = (i / 2) % 2 == 0 ? 2 : -2;  // from -1 to 1 rail unit/s in 2 s, and back
    pieces[i] = i % 2 == 0 ? firmware::ProfilePiece{1, 0, a} : firmware::ProfilePiece{1, a, 0};
  }
  if (!profile->set(0, -1, pieces.data(), static_cast<int>(pieces.size()))) throw std::runtime_error("no profile");
  run(state, *profile, 20000 / 0.625);
}
BENCHMARK(StepTickSCurve)->Apply(as_many_calls_as_asked);

}  // namespace
}  // namespace ballast::benchmarks
