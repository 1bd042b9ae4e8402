// The cost of one control tick of the paper's ball: each station of the lap alone, then the lap.
//   build/bin/ballast-benchmarks --benchmark_repetitions=9 --benchmark_report_aggregates_only=true
// Machines are noisy: read the ratios between lines of one run.
#include <benchmark/benchmark.h>

#include <memory>
#include <stdexcept>

#include "firmware/control/controller.h"
#include "tools/benchmarks/scenario.h"
#include "tools/program/params.h"
#include "tools/recording/recorder.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"

namespace ballast::benchmarks {
namespace {

std::unique_ptr<firmware::ControllerParams> controller_params(const sim::Scenario& s) {
  auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto refusal = program::to_controller_params(s, *params)) throw std::runtime_error(*refusal);
  return params;
}

void PlantTick(benchmark::State& state, const char* actuation) {
  const auto s = paper_ball(actuation);
  auto plant = std::make_unique<sim::Plant>(s);
  std::int64_t k = 0;
  for (auto _ : state) {
    if (++k > 20000) {
      state.PauseTiming();
      plant = std::make_unique<sim::Plant>(s);
      k = 1;
      state.ResumeTiming();
    }
    plant->advance(static_cast<double>(k) * 0.001, {});
  }
}
BENCHMARK_CAPTURE(PlantTick, prescribed, "prescribed")->Apply(as_many_calls_as_asked);
BENCHMARK_CAPTURE(PlantTick, stepper_holding, "stepper")->Apply(as_many_calls_as_asked);

void ControllerTick(benchmark::State& state) {
  const auto s = paper_ball("stepper");
  const auto params = controller_params(s);
  auto controller = std::make_unique<firmware::ControllerState>();
  firmware::reset(*params, *controller);
  firmware::Inputs inputs;
  firmware::StepCommand steps;
  firmware::ControllerStatus status;
  const auto tick = [&](std::int64_t k, firmware::OperatorCommand command) {
    inputs.tick = inputs.sensors.tick = inputs.monitor.tick = k;
    inputs.operator_command = command;
    firmware::tick(*params, *controller, inputs, steps);
    firmware::predict(*params, *controller);
    firmware::measure(*params, inputs, *controller);
    firmware::report(*params, *controller, inputs, status);
  };
  tick(-2, firmware::OperatorCommand::kArm);
  tick(-1, firmware::OperatorCommand::kStart);
  std::int64_t k = 0;
  for (auto _ : state) tick(k++, firmware::OperatorCommand::kNone);
}
BENCHMARK(ControllerTick)->Apply(as_many_calls_as_asked);

void MonitorTick(benchmark::State& state) {
  const auto s = paper_ball("prescribed");
  sim::Plant plant(s);
  sil::PlantMessages m = sil::plant_messages(s, plant.sample(), 0, false);
  monitor::Monitor monitor(program::to_monitor_limits(s));
  for (auto _ : state) {
    benchmark::DoNotOptimize(monitor.judge({&m.contact, &m.state, &m.sensors, nullptr}));
    ++m.contact.tick, ++m.state.tick, ++m.sensors.tick;
  }
}
BENCHMARK(MonitorTick)->Apply(as_many_calls_as_asked);

void RecordTick(benchmark::State& state) {
  const auto s = paper_ball("stepper");
  sim::Plant plant(s);
  const sil::PlantMessages m = sil::plant_messages(s, plant.sample(), 0, false);
  sil::Recorder recorder("/dev/null");
  for (auto _ : state) {
    recorder.record(hal::kChannelContact, m.contact);
    recorder.record(hal::kChannelPlantState, m.state);
    recorder.record(hal::kChannelSensors, m.sensors);
    recorder.record(hal::kChannelTrip, trip_t{});
    recorder.record(hal::kChannelControllerStatus, controller_status_t{});
    recorder.record(hal::kChannelStepCommand, step_command_t{});
  }
}
BENCHMARK(RecordTick)->Apply(as_many_calls_as_asked);

// Everything on, as `ballast run` does it; the log goes to /dev/null.
void WholeRunPerTick(benchmark::State& state, const char* actuation) {
  const auto s = paper_ball(actuation);
  const bool stepper = s.run.actuation == sim::Actuation::kStepper;
  const auto params = stepper ? controller_params(s) : nullptr;
  std::int64_t ticks = 0;
  for (auto _ : state) {
    sil::InProcessPeers peers(params.get(), program::to_monitor_limits(s), s.run.control_period_s);
    sil::Recorder recorder("/dev/null");
    ticks += sil::run(s, peers, recorder, {}).ticks;
  }
  state.counters["per_tick"] =
      benchmark::Counter(static_cast<double>(ticks), benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
  state.counters["times_real_time"] =
      benchmark::Counter(static_cast<double>(ticks) * s.run.control_period_s, benchmark::Counter::kIsRate);
}
BENCHMARK_CAPTURE(WholeRunPerTick, prescribed, "prescribed")
    ->Unit(benchmark::kMillisecond)
    ->Apply(as_many_calls_as_asked);
BENCHMARK_CAPTURE(WholeRunPerTick, stepper, "stepper")->Unit(benchmark::kMillisecond)->Apply(as_many_calls_as_asked);

}  // namespace
}  // namespace ballast::benchmarks

BENCHMARK_MAIN();
