// Runs seeds on all cores in processes of their own, so that a run that crashes or hangs affects no other and is
// reported.
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
  double seed_limit_s = 120;  // wall time; a seed that takes longer is killed and breaks `patient`
  const volatile std::sig_atomic_t* interrupted = nullptr;  // nonzero: no more
};

// Calls `run` in the workers. In this process it calls `done` for each result, in the order in which seeds end, and
// `wait` several times a second. A seed whose worker dies breaks `ended`. Returns empty if all seeds are done or it was
// interrupted, otherwise the reason for the failure. All workers have ended then.
std::string run_seeds(const WorkerOptions& options, const std::function<SeedResult(std::uint64_t)>& run,
                      const std::function<void(const SeedResult&)>& done, const std::function<void()>& wait);

}  // namespace ballast::soak
