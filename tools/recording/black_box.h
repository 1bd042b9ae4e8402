// The files that reproduce a run's end: the scenario as it ran, and for a run that ended badly the folder `blackbox/`
// with the last ticks of its log, a description of the end, and the commands that show it again.
#pragma once

#include <optional>
#include <string>

#include "tools/recording/output_dir.h"
#include "tools/recording/recorder.h"
#include "tools/sil/run.h"

namespace ballast::sil {

// scenario.toml: the scenario, overrides applied, under a comment that names the firmware's sources. Gives the same
// fingerprint.
std::string scenario_file(const sim::Scenario& scenario);

// The number of the firmware's sources, from such a text (none: the text has none) or of this program.
std::optional<std::string> firmware_sources(const std::string& scenario_file);
std::string own_firmware_sources();

// Whether a run gets a black box: not if it completed inside the envelope, was refused, or was ended by the user.
bool ended_badly(const RunResult& result);

// The commands that show a run's end again; empty: there is none. Paths are absolute, and all is quoted for a shell.
struct Again {
  // Repeats the run: `ballast run` or `ballast move` of its scenario. Empty if operators have given commands.
  std::string run;
  // Replays the whole log, where `run` is empty or where the run broke off for a reason that may not recur.
  std::string replay;

  // "; again: .." for the terminal, one command per line; empty if both are empty.
  [[nodiscard]] std::string text() const;
};

// `firmware_options`, `run_options`: as in RecordOptions.
Again again_of(const sim::Scenario& scenario, const RunResult& result, const RunOptions& options,
               const std::string& firmware_options, const std::string& run_options, const OutputDir& output);

// Writes blackbox/ into the output folder: run.lcmlog (the last Recorder::tail_ticks() or a few more; none without a
// log), scenario.toml, blackbox.json. The log must be closed. False: `output.error()` says why, and no part is left.
bool write_black_box(const sim::Scenario& scenario, const RunResult& result, const Again& again,
                     const Recorder& recorder, OutputDir& output);

}  // namespace ballast::sil
