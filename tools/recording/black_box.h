// What it takes to see once more how a run ended: the scenario as it was run, and, of a run that ended badly, the
// folder `blackbox/` with the last ticks of its log, what is known of the end, and the commands that show it again.
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

// The number of the firmware's sources in such a text, or of this program's. nullopt: the text has none.
std::optional<std::string> firmware_sources(const std::string& scenario_file);
std::string own_firmware_sources();

// Whether a run's end deserves one: everything but completed inside the envelope, refused, or ended by the user.
bool ended_badly(const RunResult& result);

// The commands that show a run's end again; empty: there is none. Paths are absolute, and all is quoted for a shell.
struct Again {
  // Does all of it again: `ballast run` or `ballast move` of its scenario. Not where people have had their say.
  std::string run;
  // Gives the whole log to the firmware, where `run` is empty, or where the run broke off over something that may not
  // come again.
  std::string replay;

  // "; again: ..", for people, a command to a line; empty if both are.
  [[nodiscard]] std::string text() const;
};

// `firmware_options`, `run_options`: as in RecordOptions.
Again again_of(const sim::Scenario& scenario, const RunResult& result, const RunOptions& options,
               const std::string& firmware_options, const std::string& run_options, const OutputDir& output);

// Writes blackbox/ into the output folder: run.lcmlog (the last Recorder::tail_ticks() or a few more),
// scenario.toml, blackbox.json. The log must be closed. False: `output.error()` says why, and
// nothing of it is left.
bool write_black_box(const sim::Scenario& scenario, const RunResult& result, const Again& again,
                     const Recorder& recorder, OutputDir& output);

}  // namespace ballast::sil
