// A recorded run's inputs, given to the firmware of today; its outputs are held against the recorded ones, bit for bit.
#pragma once

#include <csignal>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/sil/lap.h"

namespace ballast::sil {

struct ReplayOptions {
  std::int64_t until_tick = std::numeric_limits<std::int64_t>::max();  // the last one to be replayed
  const volatile std::sig_atomic_t* interrupted = nullptr;
};

struct ReplayResult {
  enum class End { kReplayed, kUnusable, kAskedForNothing, kFailed };  // the third: until_tick is before the log
  End end = End::kReplayed;
  std::string trouble;             // if it is not kReplayed: why, in one line
  std::vector<std::string> notes;  // what the log lacks
  std::int64_t first_tick = 0, last_tick = 0;
  // In the middle of the log a tick is not there, or not whole: nothing after last_tick has been replayed. What is
  // wrong there, and the last tick that the log has after it.
  struct Gap {
    std::string what;
    std::int64_t goes_on_to;
  };
  std::optional<Gap> gap;
  std::int64_t ticks = 0, ticks_that_differ = 0;
  std::optional<std::int64_t> first_difference;  // its tick
  std::optional<controller_status_t> trip;       // of the tick in which today's firmware trips
  // The recorded firmware's model has floats (true), doubles (false): every N it estimates is a float, or some are not.
  // None: too few numbers to tell.
  std::optional<bool> recorded_floats;
};

// What of a log has to fit before anything is replayed: the scenario whose fingerprint its sensors carry.
struct LogScenario {
  std::optional<std::int64_t> id;
  std::string trouble;  // if there is none: why
};
LogScenario scenario_of_log(const std::string& log_path);

// `peers`: the firmware, with the parameters of `scenario`, before its first tick. Its inputs are the recorded sensors,
// verdicts and commands; a command is given in the tick in which the recorded controller counted it. Writes a log to
// `replayed_log` that is the recorded one with the replayed step commands and statuses in the place of the recorded, so
// that the two can be compared by whatever compares logs.
ReplayResult replay(const sim::Scenario& scenario, const std::string& log_path, Peers& peers,
                    const std::string& replayed_log, const ReplayOptions& options);

}  // namespace ballast::sil
