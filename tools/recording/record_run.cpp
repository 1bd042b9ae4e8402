#include "tools/recording/record_run.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <iostream>

#include "tools/faults/injection.h"
#include "tools/program/program.h"
#include "tools/program/rough_time.h"
#include "tools/program/short_number.h"
#include "tools/recording/black_box.h"
#include "tools/recording/recorder.h"
#include "tools/sil/robot.h"
#include "tools/summary/controller_words.h"
#include "tools/summary/summary.h"

namespace ballast::sil {

namespace {

// A log that is worth a warning before the run.
constexpr double kLargeLog_bytes = 1e9;

// Shows the progress on stderr: a bar on a terminal, otherwise one line about a run that takes long.
class ProgressBar {
 public:
  explicit ProgressBar(bool wanted) : wanted_(wanted), terminal_(isatty(STDERR_FILENO) == 1) {}
  ~ProgressBar() {
    if (wanted_ && terminal_) std::cerr << "\r\033[K";
  }
  void show(double time_s, double end_s) {
    if (!wanted_) return;
    const double part = std::clamp(time_s / end_s, 0.0, 1.0);
    const double passed_s = std::chrono::duration<double>(Clock::now() - begun_).count();
    const double left_s = part > 0 ? passed_s * (1 / part - 1) : 0;
    if (terminal_) {
      constexpr int kWidth = 40;
      std::string bar(kWidth, '.');
      std::fill_n(bar.begin(), static_cast<int>(part * kWidth), '#');
      std::cerr << fmt::format("\r\033[K[{}] {:3.0f} %  t = {} of {} s", bar, 100 * part, program::short_time(time_s),
                               program::short_time(end_s));
      if (passed_s > kSure_s) std::cerr << fmt::format(", about {} left", program::rough_time(left_s));
    } else if (passed_s > kSure_s && left_s > kLong_s) {
      std::cerr << fmt::format("t = {} of {} s; about {} left\n", program::short_time(time_s),
                               program::short_time(end_s), program::rough_time(left_s));
      wanted_ = false;
    }
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr double kSure_s = 2, kLong_s = 60;

  bool wanted_, terminal_;
  Clock::time_point begun_ = Clock::now();
};

// Says what a full disk leaves. Readers of logs stop where the last event is cut off.
std::string full_disk_text(const RunResult& result, const OutputDir& output) {
  return fmt::format(
      "; the run ended at t = {} s. Kept: {}, as far as it could be written. Lost: the rest of the log, the summary "
      "and "
      "the black box. `--no-log` runs without a log",
      program::short_time(result.final_sample.time_s), output.log_path());
}

}  // namespace

int record_run(const char* program_name, const sim::Scenario& scenario, Peer& peers, OutputDir& output,
               const RecordOptions& options) {
  const auto complain = [&](const std::string& text) {
    if (options.complain)
      options.complain(text);
    else
      program::complain(program_name, text);
  };
  const auto fail = [&](const std::string& text) {
    complain(text);
    return program::kExitCouldNotRun;
  };
  if (options.other_plant != nullptr) {
    if (const std::string why = options.other_plant->listen(); !why.empty()) return fail(why);
  }
  // The results of an earlier run stay until this one can begin.
  if (peers.connect() != hal::Status::kOk) {
    complain(peers.trouble());
    return exit_status(peers.failure());
  }
  if (options.begins) options.begins();
  output.clear();
  // Written before the log, so that an interrupted run leaves them too.
  if (!output.write("robot.json", robot_json(scenario)) || !output.write("scenario.toml", scenario_file(scenario)))
    return fail(output.error());
  const double log_bytes = expected_log_bytes(scenario);
  if (!options.no_log && !options.move && log_bytes > kLargeLog_bytes) {
    complain(fmt::format("the log will have about {} GB; `ballast run --no-log` runs without one",
                         program::significant(log_bytes / 1e9, 2)));
  }
  Recorder recorder(options.no_log ? "" : output.log_path(), options.bus, options.unbuffered, options.run_id,
                    Recorder::tail_ticks(scenario.run.control_period_s));
  if (!recorder.good()) return fail(recorder.error());

  RunOptions run_options{.speed = options.speed,
                         .interrupted = options.interrupted,
                         .check_steps = options.check_steps,
                         .progress = {},
                         .move = options.move,
                         .by_hand = options.by_hand};
  if (options.other_plant != nullptr) run_options.disturbed = [&options] { return options.other_plant->heard(); };
  RunResult result;
  {
    ProgressBar bar(!options.quiet);
    run_options.progress = [&](double time_s, double end_s) {
      bar.show(time_s, end_s);
      if (options.progress) options.progress(time_s, end_s);
    };
    result = run_with_faults(scenario, peers, recorder, run_options);
  }
  if (!recorder.close() || result.sink_failed) {
    std::string text = recorder.good() ? result.trouble : recorder.error();
    if (!recorder.bus_failed()) text += full_disk_text(result, output);
    return fail(text);
  }
  if (result.refusal) {
    const bool moves = options.move.has_value();
    complain(fmt::format("the controller refuses the {}: {}", moves ? "move" : "start",
                         refusal_text(*result.refusal, moves ? &*options.move : nullptr)));
    return program::kExitUsage;
  }
  Again again;
  const auto keep_black_box = [&] {
    if (!ended_badly(result)) return;
    again = again_of(scenario, result, run_options, options.firmware_options, options.run_options, output);
    if (options.no_log) again.replay.clear();
    if (write_black_box(scenario, result, again, recorder, output)) return;
    complain(output.error() + "; nothing of the black box is kept");
    again = Again();
  };
  if (result.status != hal::Status::kOk) {
    keep_black_box();
    std::string text = result.trouble;
    if (!options.no_log) text += "; " + output.log_path() + " holds what happened up to then";
    complain(text + again.text());
    return exit_status(result.failure);
  }
  // The summary comes first: a disk that is nearly full may have no room for the black box.
  const bool written = (!result.belief || output.write("belief.csv", belief_csv(result))) &&
                       output.write_summary(summary_json(scenario, result));
  if (!written) complain(output.error());
  if (written) keep_black_box();
  if (options.quiet) {
    for (const std::string& warning : warnings(scenario, result)) complain(warning);
  } else {
    std::cout << summary_text(scenario, result, output.path());
    if (const std::string text = again.text(); !text.empty())
      std::cout << "  black box   " << (output.path() / kBlackBox).string() << text << '\n';
    std::cout << std::flush;
  }
  const int status = exit_status(result);
  return written || status != program::kExitCompleted ? status : program::kExitCouldNotRun;
}

double expected_log_bytes(const sim::Scenario& scenario) {
  // The messages of one tick, with a controller and without.
  const double bytes_per_tick = sim::has_controller(scenario.run.actuation) ? 2650 : 1140;
  const double ticks =
      scenario.duration_s / scenario.run.control_period_s - static_cast<double>(scenario.run.first_tick());
  return ticks * bytes_per_tick;
}

int exit_status(PeerFailure failure) {
  switch (failure) {
    case PeerFailure::kLost:
      return program::kExitCouldNotRun;
    case PeerFailure::kFirmwareFault:
      return program::kExitFirmwareFault;
    case PeerFailure::kFirmwareHung:
      return program::kExitFirmwareHung;
    case PeerFailure::kLate:
      return program::kExitLate;
    case PeerFailure::kForeignFirmware:
      return program::kExitForeignFirmware;
  }
  return program::kExitCouldNotRun;
}

}  // namespace ballast::sil
