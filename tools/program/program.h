// What all programs have in common: exit statuses, command line, reading the scenario, signals.
#pragma once

#include <csignal>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/lcm/channels.h"
#include "sim/scenario/scenario.h"

namespace CLI {  // its header costs the compiler 9 s wherever it is read: only where options are added
class App;
class Validator;
}  // namespace CLI

namespace ballast::program {

inline constexpr int kExitCompleted = 0;    // inside the envelope
inline constexpr int kExitUsage = 1;        // bad command line or scenario
inline constexpr int kExitCouldNotRun = 2;  // files, bus, a peer lost
inline constexpr int kExitEnvelope = 3;     // the envelope was violated, or the monitor tripped
// Of runs with the firmware on a microcontroller:
inline constexpr int kExitFirmwareFault = 4;    // it took a fault, its stack's guard included
inline constexpr int kExitFirmwareHung = 5;     // its watchdog ended it
inline constexpr int kExitLate = 6;             // a control tick, or a step pulse, came late
inline constexpr int kExitForeignFirmware = 7;  // types, build or parameters are not this program's

struct ScenarioOptions {
  std::string scenario;               // a file, or the name of one that ships
  std::vector<std::string> set;       // KEY=VALUE
  std::vector<std::string> fault;     // KIND@TIME[:PARAM]
  std::string actuation;              // empty: as the scenario says
  std::optional<std::uint64_t> seed;  // none: as the scenario says
};

struct BusOptions {
  std::string url = hal::kDefaultLcmUrl;
  double start_timeout_s = 30;  // until the first tick
  double peer_timeout_s = 2;    // from one tick to the next
};

// For numbers of options: finite and > 0. CLI11's own check lets NaN and infinity through.
CLI::Validator positive_finite();
// For texts of options: an empty one is a shell variable that was not set.
CLI::Validator not_empty();

// Both structs must outlive the parsing.
void add_scenario_options(CLI::App& app, ScenarioOptions& options);
void add_bus_options(CLI::App& app, BusOptions& options);

// A microcontroller's firmware that was built beside this program; its board is a folder of hal/.
[[nodiscard]] std::string default_firmware(const std::string& board);

// A value: the program ends here with this status; help or the error has been printed.
[[nodiscard]] std::optional<int> parse(CLI::App& app, int argc, char** argv);

// Reads and checks; prints every fault to stderr. nullopt: end with kExitUsage.
[[nodiscard]] std::optional<sim::Scenario> load_scenario(const ScenarioOptions& options);

// What to type for `ballast`, which need not be on the PATH: where this program was started, as it was typed there, or
// from everywhere. One word of a shell's line.
[[nodiscard]] std::string ballast_as_typed(bool from_everywhere = false);

// As one word of a shell's line, whatever is in it; quoted only if it has to be.
[[nodiscard]] std::string shell_word(const std::string& text);

// " --lcm URL --peer-timeout S", where they are not as by default.
[[nodiscard]] std::string as_typed(const BusOptions& options);

// "name: text" on stderr, in one piece: processes share a terminal.
void complain(const std::string& program_name, const std::string& text);

// What every program says of a URL of which LCM can make no bus.
[[nodiscard]] std::string bad_bus(const std::string& url);

// Complains of it, names who looks why, and gives the exit status for it.
[[nodiscard]] int refuse_bus(const std::string& program_name, const std::string& url);

// SIGINT, SIGTERM and SIGHUP (unless it is ignored, as under nohup) no longer kill; they set the flag returned here to
// their number.
const volatile std::sig_atomic_t* catch_signals();

// What a program says that one of these has ended: "interrupted", or that it was told so by the one that started it.
[[nodiscard]] const char* interruption();

// What main() gives back: `exit_status`; but kExitCouldNotRun for success if standard output has not taken all that was
// printed, which is complained of.
[[nodiscard]] int after_output(const std::string& program_name, int exit_status);

}  // namespace ballast::program
