// A whole run with its results on disk, for `ballast run`, `ballast move` and `ballast-plant`.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "tools/recording/output_dir.h"
#include "tools/sil/other_plant.h"
#include "tools/sil/run.h"

namespace ballast::sil {

struct RecordOptions {
  bool quiet = false;                 // no progress bar and no summary; warnings go to stderr
  double speed = 0;                   // as in RunOptions
  lcm::LCM* bus = nullptr;            // every message is also published there
  std::int64_t run_id = 0;            // on that bus
  OtherPlant* other_plant = nullptr;  // listens for another plant on that bus; null: nobody does
  bool no_log = false;                // keep no run.lcmlog
  bool check_steps = false;           // as in RunOptions
  std::string firmware_options{};     // command-line options that a repeated run and a replay need: " --firmware qemu"
  std::string run_options{};          // command-line options that only a repeated run needs: " --processes"
  bool unbuffered = false;            // every message is on disk at once, for runs whose processes may be killed
  const volatile std::sig_atomic_t* interrupted = nullptr;
  std::optional<firmware::MoveRequest> move = std::nullopt;  // as in RunOptions
  bool by_hand = false;                                      // as in RunOptions
  std::function<void()> begins{};                            // called once the run can begin
  // Takes warnings and errors; none: they go to stderr, after the program's name.
  std::function<void(const std::string& text)> complain{};
  std::function<void(double time_s, double end_s)> progress{};  // called now and then, beside the bar
};

// Runs with the scenario's faults, writes run.lcmlog, robot.json, scenario.toml, summary.json and, with a
// [believed], belief.csv, and prints the summary. Returns the program's exit status. A run that could not go to its end
// leaves the log up to there and no summary. A run that ended badly, so or otherwise, also leaves a black box, unless
// the disk is full.
int record_run(const char* program_name, const sim::Scenario& scenario, Peer& peers, OutputDir& output,
               const RecordOptions& options);

// About how many bytes the log of a whole run will have.
double expected_log_bytes(const sim::Scenario& scenario);

// The exit status of a program whose peers have failed.
int exit_status(PeerFailure failure);

}  // namespace ballast::sil
