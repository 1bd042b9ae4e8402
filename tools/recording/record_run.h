// A whole run with its results on disk, for `ballast run` and `ballast-plant`: peers are given, the rest is the same.
#pragma once

#include <filesystem>
#include <optional>

#include "tools/sil/other_plant.h"
#include "tools/recording/output_dir.h"
#include "tools/sil/run.h"

namespace ballast::sil {

struct RecordOptions {
  bool quiet = false;                 // no progress bar, no summary; what must not stay unsaid is said on stderr
  double speed = 0;                   // as in RunOptions
  lcm::LCM* bus = nullptr;            // every message also goes there
  std::int64_t run_id = 0;            // on that bus
  OtherPlant* other_plant = nullptr;  // who listens whether it is one's own; null: nobody does
  bool check_steps = false;           // as in RunOptions
  std::string firmware_options{};  // of the command line, that a run or replay needs to be the same: " --firmware qemu"
  std::string run_options{};       // likewise, that a replay has not: " --processes"
  bool unbuffered = false;         // every message is on disk at once: for runs whose processes may be killed
  const volatile std::sig_atomic_t* interrupted = nullptr;
  std::optional<firmware::MoveRequest> move = std::nullopt;  // as in RunOptions
  bool by_hand = false;                                      // as in RunOptions
};

// Runs, writes run.lcmlog, robot.json, scenario.toml and summary.json, prints the summary. Returns the program's exit
// status; trouble goes to stderr, after `program_name`. A run that could not go to its end leaves the log up to there
// and no summary; one that ended badly, so or otherwise, a black box (but not on a disk that is full, be it by the
// fault disk_full).
int record_run(const char* program_name, const sim::Scenario& scenario, Peers& peers, OutputDir& output,
               const RecordOptions& options);

}  // namespace ballast::sil
