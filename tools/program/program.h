// Parts that all programs share: exit statuses, command line, reading the scenario, signals.
#pragma once

#include <csignal>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "hal/lcm/channels.h"
#include "sim/scenario/scenario.h"

namespace CLI {  // CLI11's header costs the compiler 9 s, so only files that add options read it
class App;
class Validator;
}  // namespace CLI

namespace ballast::program {

inline constexpr int kExitCompleted = 0;    // completed inside the envelope
inline constexpr int kExitUsage = 1;        // bad command line or scenario
inline constexpr int kExitCouldNotRun = 2;  // file or bus error, or a peer was lost
inline constexpr int kExitEnvelope = 3;     // the envelope was violated, or the monitor tripped
// With the firmware on a microcontroller:
inline constexpr int kExitFirmwareFault = 4;    // processor fault, including the stack guard's
inline constexpr int kExitFirmwareHung = 5;     // the watchdog ended it
inline constexpr int kExitLate = 6;             // a control tick or a step pulse was late
inline constexpr int kExitForeignFirmware = 7;  // types, build or parameters differ from this program's

struct ScenarioOptions {
  std::string scenario;               // a file, or the name of a shipped scenario
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

// Advice to a peer that hears a run of another scenario.
inline constexpr const char* kOwnBus = "; if another run is on this bus, give every run a bus of its own with --lcm";

// Checks that a number is finite and > 0. CLI11's own check accepts NaN and infinity.
CLI::Validator positive_finite();
// Checks that a text is one of these.
CLI::Validator one_of(const std::vector<std::string>& names);

// Checks that a number is whole, and in this range.
CLI::Validator whole_number(int low, int high);

// Checks that a text is not empty, as that of a shell variable that is not set.
CLI::Validator not_empty();

// `options` must outlive the parsing.
void add_scenario_options(CLI::App& app, ScenarioOptions& options);
void add_bus_options(CLI::App& app, BusOptions& options);

// The firmware for a microcontroller that this program comes with. `board` is a folder of hal/.
[[nodiscard]] std::string default_firmware(const std::string& board);

// Parses the command line. With a value, the program ends here with this status; help or the error has been printed.
[[nodiscard]] std::optional<int> parse(CLI::App& app, int argc, char** argv);

// For the program of one peer: adds the options of scenario and bus to `app`, parses, and reads the scenario. nullopt:
// `options.scenario` is there. Otherwise as parse().
struct PeerOptions {
  ScenarioOptions scenario_options;
  BusOptions bus;
  std::optional<sim::Scenario> scenario;
};
[[nodiscard]] std::optional<int> parse_peer(CLI::App& app, int argc, char** argv, PeerOptions& options);

// The file of a scenario, or of the shipped scenario of that name. Empty: there is none, which is printed.
[[nodiscard]] std::filesystem::path find_scenario(const std::string& file_or_name);

// The names of the shipped scenarios, in order.
[[nodiscard]] std::vector<std::string> shipped_names();

// Reads and checks a scenario; prints every error to stderr. Without a value, end with kExitUsage. `warnings`: the
// values that are allowed and implausible.
[[nodiscard]] std::optional<sim::Scenario> load_scenario(const ScenarioOptions& options,
                                                         std::vector<sim::ScenarioError>* warnings = nullptr);

// The file of a scenario that is given by its path, or by its name among those that ship. Empty: `why` says that there
// is none.
[[nodiscard]] std::string scenario_file(const std::string& name_or_path, std::string& why);

// The shell word that starts `ballast`, which may not be in PATH: as typed by the user for this program, or as an
// absolute path.
[[nodiscard]] std::string ballast_as_typed(bool absolute = false);

// `text` as one word of a shell command, quoted only where necessary.
[[nodiscard]] std::string shell_word(const std::string& text);

// " --lcm URL --peer-timeout S", without those that have their default.
[[nodiscard]] std::string as_typed(const BusOptions& options);

// Prints "name: text" to stderr in one write, since processes share a terminal.
void complain(const std::string& program_name, const std::string& text);

// The message for a URL that LCM does not accept.
[[nodiscard]] std::string bad_bus(const std::string& url);

// Prints that message with the command that examines the bus. Returns the exit status.
[[nodiscard]] int refuse_bus(const std::string& program_name, const std::string& url);

// After this call SIGINT, SIGTERM and SIGHUP (unless ignored, as under nohup) no longer kill the process. They set the
// returned flag to their number. A second SIGINT or SIGTERM kills, if it comes later than 0.2 s after the first.
const volatile std::sig_atomic_t* catch_signals();

// The message of a program that such a signal has ended: "interrupted", or that its parent process has ended it.
[[nodiscard]] const char* interruption();

// The exit status for main(): `exit_status`, or kExitCouldNotRun in place of success if standard output could not be
// written. The failure is printed.
[[nodiscard]] int after_output(const std::string& program_name, int exit_status);

}  // namespace ballast::program
