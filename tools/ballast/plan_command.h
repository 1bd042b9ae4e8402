// Parts that `ballast plan`, `ballast plan --chart` and `ballast plan --gains` share.
#pragma once

#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "tools/plan/read_task.h"

namespace ballast {

struct PlanCommand {
  std::string task;
  std::string out;
  std::string from;
  std::uint64_t seed = 0;
  std::optional<double> time_limit_s;
  bool quiet = false;
  bool chart = false;
  bool gains = false;
};

using Clock = std::chrono::steady_clock;
[[nodiscard]] double seconds_since(Clock::time_point start);

// Runs with motors after a search may go on for this long after --time-limit.
constexpr double kMotorsAllowance_s = 1;

// True once a signal came, or the time limit and `allowance_s` have passed since `start`.
[[nodiscard]] std::function<bool()> stop_of(const PlanCommand& command, Clock::time_point start,
                                            const volatile std::sig_atomic_t* signalled, double allowance_s = 0);

// The task of the command; without a value its errors have been printed.
[[nodiscard]] std::optional<plan::TaskFile> task_of(const PlanCommand& command);

// Writes a whole file or none.
// Why no file can take this place, where a folder, a device, a pipe or a socket is; empty: none is.
[[nodiscard]] std::string in_the_way(const std::filesystem::path& path);

[[nodiscard]] bool write_file(const std::filesystem::path& path, const std::string& text);

// One line on a terminal that is written over; elsewhere a line a second.
class ProgressLine {
 public:
  explicit ProgressLine(bool quiet);
  // True: the line is due.
  [[nodiscard]] bool due() const;
  void show(const std::string& text);
  void end();

 private:
  bool quiet_, terminal_, open_ = false;
  Clock::time_point shown_ = Clock::now();
};

// `ballast plan --chart` and `ballast plan --gains`: return the exit status.
int chart_task(const PlanCommand& command);
int write_gains(const PlanCommand& command);

}  // namespace ballast
