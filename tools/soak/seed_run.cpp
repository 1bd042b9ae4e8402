#include "tools/soak/seed_run.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string_view>

#include "tools/faults/injection.h"
#include "tools/program/memory_file.h"
#include "tools/program/params.h"
#include "tools/recording/recorder.h"
#include "tools/summary/summary.h"

namespace ballast::soak {

namespace {

Outcome outcome_of(const sil::RunResult& result) {
  if (result.status != hal::Status::kOk) return Outcome::kGivenUp;
  const bool tripped = result.trip.tripped != 0 || result.controller_trip.has_value();
  switch (result.end_reason) {
    case sil::EndReason::kCompleted:
      return tripped ? Outcome::kCutShort : Outcome::kCompleted;
    case sil::EndReason::kTripped:
      return result.masses_rested ? Outcome::kStopped : Outcome::kStillMoving;
    case sil::EndReason::kSlipped:
      return Outcome::kSlipped;
    case sil::EndReason::kDetached:
      return Outcome::kDetached;
    case sil::EndReason::kInconsistent:
    case sil::EndReason::kStepTiming:
      return Outcome::kInconsistent;
  }
  return Outcome::kInconsistent;
}

void note_broken(const Broken& broken, SeedResult& out) {
  if (out.broken >= 0) return;
  out.broken = static_cast<std::int32_t>(broken.invariant);
  out.broken_tick = broken.tick;
  set_text(out.broken_text, broken.text);
}

constexpr std::uint64_t kRepeatEvery = 32;

SeedResult without_scenario(std::uint64_t seed, const RandomScenario& random) {
  SeedResult out;
  out.seed = seed;
  note_broken({Invariant::kEnded, 0, "no scenario that can be run came of it: " + random.trouble}, out);
  return out;
}

SeedResult result_of(std::uint64_t seed, const RandomScenario& random, const SeedRun& run) {
  SeedResult out;
  out.seed = seed;
  out.refused = random.refused;
  out.faults = static_cast<std::int32_t>(random.faults.size());
  out.ticks = run.result.ticks;
  out.simulated_us = std::llround(1e6 * run.result.final_sample.time_s);
  out.outcome = outcome_of(run.result);
  out.violated = run.violated;
  for (const Broken& broken : run.broken) note_broken(broken, out);
  return out;
}

// The first to notice, by messages and summary. If monitor and controller notice in the same tick, the one that did not
// learn it from the other counts.
void note_detection(const sim::Scenario& scenario, const sil::RunResult& result, SeedResult& out) {
  constexpr auto kToldByTheMonitor = static_cast<std::uint32_t>(firmware::Fault::kMonitorTrip);
  std::int64_t tick = std::numeric_limits<std::int64_t>::max();
  std::string who = "nobody";
  const auto notice = [&](std::int64_t at, const std::string& by) {
    if (at >= tick) return;
    tick = at;
    who = by;
  };
  if (result.trip.tripped != 0)
    notice(result.trip.trip_tick, std::string("monitor: ") + sil::trip_cause(result.trip.cause));
  if (const auto& trip = result.controller_trip) {
    if ((static_cast<std::uint32_t>(trip->faults) & ~kToldByTheMonitor) != 0)
      notice(trip->tick, std::string("controller: ") + sil::fault_cause(trip->faults));
  }
  // last_tick is in the log. What could not be written or published belongs to the next tick.
  if (out.outcome == Outcome::kGivenUp) notice(result.last_tick + (result.status == hal::Status::kIo), "the run");
  out.detected = tick != std::numeric_limits<std::int64_t>::max();
  if (!out.detected) {
    const auto& lost = result.final_sample.lost_steps;
    const bool counted = std::ranges::any_of(lost, [](std::int64_t steps) { return steps != 0; }) ||
                         std::ranges::any_of(result.motors, [](const auto& motor) { return motor.slips != 0; });
    if (counted) who = "the summary: lost steps";
  }
  set_text(out.detected_by, who);
  if (!out.detected) return;
  // A fault between two ticks affects the later one, with the rounding of Fault::begun().
  const double onset = scenario.faults.front().time_s / scenario.run.control_period_s;
  out.detected_after = tick - static_cast<std::int64_t>(std::ceil(onset - 1e-6));
}

}  // namespace

const char* to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::kCompleted:
      return "completed";
    case Outcome::kStopped:
      return "tripped, masses at rest";
    case Outcome::kStillMoving:
      return "tripped, masses still moving";
    case Outcome::kCutShort:
      return "tripped, over before they rest";
    case Outcome::kSlipped:
      return "slipped";
    case Outcome::kDetached:
      return "detached";
    case Outcome::kInconsistent:
      return "inconsistent";
    case Outcome::kGivenUp:
      return "given up, with reason";
  }
  return "";
}

SeedRun run_scenario(const RandomScenario& random) {
  const sim::Scenario& scenario = random.scenario;
  auto params = std::make_unique<firmware::ControllerParams>();
  const bool has_controller = sim::has_controller(scenario.run.actuation);
  SeedRun run{};
  if (has_controller) {
    if (const auto refusal = program::to_controller_params(scenario, *params)) {
      run.broken.push_back({Invariant::kEnded, 0, *refusal});
      return run;
    }
  }
  const program::MemoryFile log;
  const auto peers = with_operator(
      sil::peers_in_process(scenario, has_controller ? params.get() : nullptr, program::to_monitor_limits(scenario)),
      random.script, scenario.run.control_period_s);
  sil::Recorder recorder(log.path());
  Invariants invariants(scenario);
  volatile std::sig_atomic_t enough = 0;
  sil::RunOptions options;
  options.interrupted = &enough;
  options.observe = [&](const sil::Lap& lap, const sim::Plant::Sample& truth) {
    invariants.observe(lap, truth);
    if (invariants.too_long()) enough = 1;
  };
  run.result = sil::run_with_faults(scenario, *peers, recorder, options);
  recorder.close();
  invariants.finish(run.result, log.path());
  run.broken = invariants.broken();
  run.log_hash = invariants.log_hash();
  run.violated = invariants.violated();
  return run;
}

SeedResult run_seed(std::uint64_t seed) { return run_seed(seed, run_scenario); }

SeedResult run_seed(std::uint64_t seed, const Runner& run) {
  const RandomScenario random = random_scenario(seed);
  if (!random.trouble.empty()) return without_scenario(seed, random);
  const SeedRun first = run(random);
  SeedResult out = result_of(seed, random, first);
  if (seed % kRepeatEvery == 0 && run(random).log_hash != first.log_hash) {
    note_broken({Invariant::kRepeatable, first.result.last_tick, "the second run's log is another"}, out);
  }
  return out;
}

RandomScenario table_scenario(std::uint64_t seed) {
  const std::size_t kinds = sim::fault_kinds().size();
  const sim::FaultKind kind = sim::fault_kinds()[seed % kinds].kind;
  const bool one_severity = std::string_view(severity_text(kind, 0)) == severity_text(kind, 1);
  return calm_scenario(seed, kind, one_severity ? 0 : static_cast<int>(seed / kinds % 2));
}

SeedResult run_table_seed(std::uint64_t seed) {
  const RandomScenario random = table_scenario(seed);
  if (!random.trouble.empty()) return without_scenario(seed, random);
  const SeedRun with_fault = run_scenario(random);
  SeedResult out = result_of(seed, random, with_fault);
  RandomScenario twin = random;
  twin.scenario.faults.clear();
  const SeedRun without = run_scenario(twin);
  for (const Broken& broken : without.broken) note_broken(broken, out);
  if (sil::exit_status(without.result) != 0 || outcome_of(without.result) != Outcome::kCompleted) return out;
  out.fault_kind = static_cast<std::int32_t>(random.faults.front().kind);
  out.severity = random.faults.front().severity;
  note_detection(random.scenario, with_fault.result, out);
  return out;
}

}  // namespace ballast::soak
