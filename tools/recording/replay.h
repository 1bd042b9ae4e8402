// Gives a recorded run's inputs to the firmware of today and compares its outputs with the recorded ones, bit for bit.
#pragma once

#include <csignal>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/recording/rejudge.h"
#include "tools/sil/peer.h"

namespace ballast::sil {

struct ReplayOptions {
  std::int64_t until_tick = std::numeric_limits<std::int64_t>::max();  // the last to replay
  // Called before each tick: whether the recorded controller answered in it.
  std::function<void(bool answered)> before_tick{};
  const volatile std::sig_atomic_t* interrupted = nullptr;
  std::optional<monitor::MonitorLimits> judge{};  // judge plant and monitor of the log again (rejudge.h)
};

struct ReplayResult {
  enum class End { kReplayed, kUnusable, kAskedForNothing, kFailed };  // kAskedForNothing: until_tick is before the log
  End end = End::kReplayed;
  std::string trouble;             // if it is not kReplayed: why, in one line
  std::vector<std::string> notes;  // what the log lacks
  std::int64_t first_tick = 0, last_tick = 0;
  // A tick is missing or incomplete in the middle of the log: nothing after last_tick has been replayed. `what` is
  // wrong there, and the log goes on to this tick.
  struct Gap {
    std::string what;
    std::int64_t goes_on_to;
  };
  std::optional<Gap> gap;
  std::int64_t ticks = 0, ticks_that_differ = 0;
  std::optional<std::int64_t> first_difference;  // its tick
  std::optional<controller_status_t> trip;       // the status in which today's firmware trips
  std::optional<Misjudged> misjudged;            // the first finding of ReplayOptions::judge
  std::int64_t ticks_misjudged = 0;
  // True: the recorded firmware's model has floats, as every N it estimates is one. False: it has doubles. None: too
  // few numbers to tell.
  std::optional<bool> recorded_floats;
};

// The fingerprint of a log's scenario, from its first sensors message.
struct LogScenario {
  std::optional<std::int64_t> id;
  std::string trouble;  // why there is none
};
LogScenario scenario_of_log(const std::string& log_path);

// `firmware` has the parameters of `scenario` and has not served a tick. Its inputs are the recorded sensors, verdicts
// and commands; a command is given in the tick in which the recorded controller counted it. `replayed_log` becomes the
// recorded log with the replayed step commands and statuses in place of the recorded ones, so that any program that
// compares logs can compare the two.
ReplayResult replay(const sim::Scenario& scenario, const std::string& log_path, Peer& firmware,
                    const std::string& replayed_log, const ReplayOptions& options);

}  // namespace ballast::sil
