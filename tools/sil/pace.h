// The pace of a run: sleeps where it is to be no faster than the wall clock allows, and reports progress.
#pragma once

#include <chrono>

#include "tools/sil/run_options.h"

namespace ballast::sil {

class Pace {
 public:
  // `hold_s`: how long before t = 0 the pace is kept.
  Pace(const RunOptions& options, double hold_s) : options_(options), hold_s_(hold_s) {}
  // At time_s, after a tick of the simulation.
  void keep(std::int64_t tick, double time_s, double end_s);
  [[nodiscard]] double wall_time_s() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

 private:
  using Clock = std::chrono::steady_clock;

  const RunOptions& options_;
  double hold_s_;
  Clock::time_point start_ = Clock::now(), next_progress_ = start_;
};

}  // namespace ballast::sil
