// Seeds on all cores: one process each, so that a run that crashes or hangs takes nothing else with it and is told of.
#pragma once

#include <csignal>
#include <cstdint>
#include <functional>
#include <string>

#include "tools/soak/seed_run.h"

namespace ballast::soak {

struct WorkerOptions {
  std::uint64_t first = 0, last = 0;  // both included
  int jobs = 1;
  double seed_limit_s = 120;  // on the clock; a seed that takes longer is killed and is `patient` broken
  const volatile std::sig_atomic_t* interrupted = nullptr;  // nonzero: no more
};

// `run` is called in the workers, `done` in this process, in the order in which seeds come to their end, which is not
// theirs; `wait` now and then. A worker that dies makes its seed one that broke `ended`. Returns why it could not be
// done; empty: all are done, or it was interrupted. No worker is left.
std::string run_seeds(const WorkerOptions& options, const std::function<SeedResult(std::uint64_t)>& run,
                      const std::function<void(const SeedResult&)>& done, const std::function<void()>& wait);

}  // namespace ballast::soak
