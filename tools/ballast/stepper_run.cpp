#include "tools/ballast/stepper_run.h"

#include <csignal>
#include <memory>
#include <utility>

#include "tools/program/params.h"
#include "tools/sil/lap_sink.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"

namespace ballast {

SteppedRun run_with_steppers(const sim::Scenario& scenario, const Stop& stop, const Observer& observe) {
  SteppedRun run;
  const auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto why = program::to_controller_params(scenario, *params)) {
    run.refusal = *why;
    return run;
  }
  sil::InProcessPeers peers(params.get(), program::to_monitor_limits(scenario), scenario.run.control_period_s);
  if (peers.connect() != hal::Status::kOk) {
    run.refusal = "the controller does not start";
    return run;
  }
  sil::NoRecord sink;
  sil::RunOptions options;
  volatile std::sig_atomic_t stopped = stop() ? 1 : 0;
  options.interrupted = &stopped;
  options.observe = [&](const sil::Lap& lap, const sim::Plant::Sample& truth) {
    if (stop()) stopped = 1;
    if (observe) observe(lap, truth);
  };
  sil::RunResult result = sil::run(scenario, peers, sink, options);
  if (result.status != hal::Status::kOk) {
    run.refusal = result.trouble;
  } else {
    run.result = std::move(result);
  }
  return run;
}

sim::Scenario on_perfect_floor(const sim::Scenario& scenario) {
  sim::Scenario out = scenario;
  out.surface.hold_everything();
  if (out.believed) out.believed->surface.hold_everything();
  out.envelope.min_normal_force_n = 0;
  return out;
}

plan::StepperRun need_of(const sil::RunResult& result) {
  return {result.extrema.mu_required_max, to_string(result.end_reason), result.final_sample.time_s};
}

}  // namespace ballast
