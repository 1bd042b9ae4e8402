#include "tools/soak/seed_run.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>

#include "tools/program/params.h"
#include "tools/sil/in_process_peers.h"
#include "tools/sil/recorder.h"

namespace ballast::soak {

namespace {

// A file without a disk, that other code can open by its name.
class MemoryFile {
 public:
  MemoryFile() : descriptor_(memfd_create("soak", MFD_CLOEXEC)) {}
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  [[nodiscard]] std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

struct Run {
  sil::RunResult result;
  std::vector<Broken> broken;
  std::uint64_t log_hash = 0;
  bool violated = false;
};

Run run(const sim::Scenario& scenario) {
  auto params = std::make_unique<firmware::ControllerParams>();
  const bool has_controller = scenario.run.actuation == sim::Actuation::kStepper;
  Run run;
  if (has_controller) {
    if (const auto refusal = program::to_controller_params(scenario, *params)) {
      run.broken.push_back({Invariant::kEnded, 0, *refusal});
      return run;
    }
  }
  const MemoryFile log;
  sil::InProcessPeers peers(has_controller ? params.get() : nullptr, program::to_monitor_limits(scenario),
                            scenario.run.control_period_s);
  sil::Recorder recorder(log.path());
  Invariants invariants(scenario);
  volatile std::sig_atomic_t enough = 0;
  sil::RunOptions options;
  options.interrupted = &enough;
  options.observe = [&](const sil::Lap& lap, const sim::Plant::Sample& truth) {
    invariants.see(lap, truth);
    if (invariants.endless()) enough = 1;
  };
  run.result = sil::run(scenario, peers, recorder, options);
  recorder.close();
  invariants.finish(run.result, log.path());
  run.broken = invariants.broken();
  run.log_hash = invariants.log_hash();
  run.violated = invariants.violated();
  return run;
}

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
  std::snprintf(out.broken_text, sizeof out.broken_text, "%s", broken.text.c_str());
}

constexpr std::uint64_t kRepeatEvery = 32;

}  // namespace

SeedResult run_seed(std::uint64_t seed, bool /*with_twin*/) {
  SeedResult out;
  out.seed = seed;
  const RandomScenario random = random_scenario(seed);
  out.refused = random.refused;
  if (!random.trouble.empty()) {
    note_broken({Invariant::kEnded, 0, "no scenario that can be run came of it: " + random.trouble}, out);
    return out;
  }
  const Run first = run(random.scenario);
  out.ticks = first.result.ticks;
  out.simulated_us = std::llround(1e6 * first.result.final_sample.time_s);
  out.outcome = outcome_of(first.result);
  out.violated = first.violated;
  for (const Broken& broken : first.broken) note_broken(broken, out);
  if (seed % kRepeatEvery == 0 && run(random.scenario).log_hash != first.log_hash) {
    note_broken({Invariant::kRepeatable, first.result.last_tick, "the second run's log is another"}, out);
  }
  return out;
}

}  // namespace ballast::soak
