#include "tools/recording/record_run.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iostream>

#include "tools/faults/injection.h"
#include "tools/program/program.h"
#include "tools/recording/black_box.h"
#include "tools/recording/recorder.h"
#include "tools/sil/robot.h"
#include "tools/summary/controller_words.h"
#include "tools/summary/summary.h"

namespace ballast::sil {

namespace {

// A progress bar on stderr, shown only if that is a terminal.
class ProgressBar {
 public:
  explicit ProgressBar(bool wanted) : shown_(wanted && isatty(STDERR_FILENO) == 1) {}
  ~ProgressBar() {
    if (shown_) std::fprintf(stderr, "\r\033[K");
  }
  void show(double time_s, double end_s) const {
    if (!shown_) return;
    constexpr int kWidth = 40;
    const double part = std::clamp(time_s / end_s, 0.0, 1.0);
    std::string bar(kWidth, '.');
    std::fill_n(bar.begin(), static_cast<int>(part * kWidth), '#');
    std::fprintf(stderr, "\r[%s] %3.0f %%  t = %.2f of %.6g s", bar.c_str(), 100 * part, time_s, end_s);
  }

 private:
  bool shown_;
};

}  // namespace

int record_run(const char* program_name, const sim::Scenario& scenario, Peer& peers, OutputDir& output,
               const RecordOptions& options) {
  const auto fail = [&](const std::string& text) {
    program::complain(program_name, text);
    return program::kExitCouldNotRun;
  };
  if (options.other_plant != nullptr) {
    if (const std::string why = options.other_plant->listen(); !why.empty()) return fail(why);
  }
  // The results of an earlier run stay until this one can begin.
  if (peers.connect() != hal::Status::kOk) {
    program::complain(program_name, peers.trouble());
    return exit_status(peers.failure());
  }
  output.clear();
  // Written before the log, so that an interrupted run leaves them too.
  if (!output.write("robot.json", robot_json(scenario)) || !output.write("scenario.toml", scenario_file(scenario)))
    return fail(output.error());
  Recorder recorder(output.log_path(), options.bus, options.unbuffered, options.run_id,
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
    const ProgressBar bar(!options.quiet);
    run_options.progress = [&bar](double time_s, double end_s) { bar.show(time_s, end_s); };
    result = run_with_faults(scenario, peers, recorder, run_options);
  }
  // A full disk keeps what it has: readers of logs stop where the last event is cut off.
  if (!recorder.close() || result.sink_failed) {
    return fail((recorder.good() ? result.trouble : recorder.error()) + "; it holds what happened up to there");
  }
  if (result.refusal) {
    program::complain(program_name,
                      "the controller refuses the move: " + refusal_text(*result.refusal, &*options.move));
    return program::kExitUsage;
  }
  Again again;
  const auto keep_black_box = [&] {
    if (!ended_badly(result)) return;
    again = again_of(scenario, result, run_options, options.firmware_options, options.run_options, output);
    if (write_black_box(scenario, result, again, recorder, output)) return;
    program::complain(program_name, output.error() + "; nothing of the black box is kept");
    again = Again();
  };
  if (result.status != hal::Status::kOk) {
    keep_black_box();
    std::string text = result.trouble + "; " + output.log_path() + " holds what happened up to then";
    text += again.text();
    program::complain(program_name, text);
    return exit_status(result.failure);
  }
  // The summary comes first: a disk that is nearly full may have no room for the black box.
  const bool written = output.write_summary(summary_json(scenario, result));
  if (!written) program::complain(program_name, output.error());
  if (written) keep_black_box();
  if (options.quiet) {
    for (const std::string& warning : warnings(scenario, result)) program::complain(program_name, warning);
  } else {
    std::cout << summary_text(scenario, result, output.path());
    if (const std::string text = again.text(); !text.empty())
      std::cout << "  black box   " << (output.path() / kBlackBox).string() << text << '\n';
    std::cout << std::flush;
  }
  const int status = exit_status(result);
  return written || status != program::kExitCompleted ? status : program::kExitCouldNotRun;
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
