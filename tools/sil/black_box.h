// What it takes to see once more how a run ended: the scenario as it was run, and, of a run that ended badly, the
// folder `blackbox/` with the last ticks of its log, what is known of the end, and the command that repeats it.
#pragma once

#include <optional>
#include <string>

#include "tools/sil/output_dir.h"
#include "tools/sil/recorder.h"
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

// The command that repeats the run, with `firmware_options` (" --firmware qemu", or none): `ballast run` of its
// scenario where that says all, in `processes` if it was; `ballast replay` of its log where somebody has said something
// on the way, or a peer was lost. Paths are absolute and quoted for a shell.
std::string repeat_command(const RunResult& result, const RunOptions& options, const std::string& firmware_options,
                           bool processes, const OutputDir& output);

// Writes blackbox/ into the output folder: run.lcmlog (the last Recorder::tail_ticks() or a few more),
// scenario.toml, blackbox.json. The log must be closed. False: `output.error()` says why, and
// nothing of it is left.
bool write_black_box(const sim::Scenario& scenario, const RunResult& result, const std::string& command,
                     const Recorder& recorder, OutputDir& output);

}  // namespace ballast::sil
