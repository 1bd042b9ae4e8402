// ballast replay: a recorded run's inputs, given to the firmware of today.
#include <unistd.h>

#include <cinttypes>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tools/ballast/commands.h"
#include "tools/ballast/firmware_option.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/program/subprocess.h"
#include "tools/recording/black_box.h"
#include "tools/faults/faulty_peers.h"
#include "tools/qemu/qemu_peers.h"
#include "tools/recording/replay.h"

namespace ballast {

namespace {

namespace fs = std::filesystem;

constexpr int kExitDiffers = 3;
constexpr int kExitGap = 8;  // 4 to 7 are the microcontroller's

struct ReplayCommand : FirmwareOption {
  std::string log;
  std::string scenario;  // empty: scenario.toml beside the log
  std::string out;       // empty: the replayed log is thrown away
  sil::ReplayOptions replay;
  bool verify = false;
};

int refuse(const std::string& text) {
  program::complain("ballast", text);
  return program::kExitUsage;
}

// It is the files' fault, not of how it was asked.
int could_not(const std::string& text) {
  program::complain("ballast", text);
  return program::kExitCouldNotRun;
}

// A file of one's own, gone with the object.
class TemporaryLog {
 public:
  TemporaryLog() {
    // mkdtemp puts six letters of its own in the place of the six X.
    std::string name = (fs::temp_directory_path() / "ballast-replay-").string() + std::string(6, 'X');
    if (mkdtemp(name.data()) != nullptr) folder_ = name;
  }
  ~TemporaryLog() {
    std::error_code code;
    if (!folder_.empty()) fs::remove_all(folder_, code);
  }
  TemporaryLog(const TemporaryLog&) = delete;
  TemporaryLog& operator=(const TemporaryLog&) = delete;
  [[nodiscard]] std::string path() const { return folder_.empty() ? "" : (folder_ / "replayed.lcmlog").string(); }

 private:
  fs::path folder_;
};

std::string file_text(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

// By the summary that the run has left beside its log; empty: the log is as long as it was, or there is no summary.
std::string length_fault(const fs::path& log) {
  if (log.filename() != "run.lcmlog") return "";  // another one, which the summary does not speak of
  std::ifstream file(log.parent_path() / "summary.json");
  const auto summary = nlohmann::json::parse(file, nullptr, false);
  if (!summary.is_object() || !summary.value("log_bytes", nlohmann::json()).is_number_integer()) return "";
  std::error_code code;
  const auto is = static_cast<std::int64_t>(fs::file_size(log, code)), was = summary["log_bytes"].get<std::int64_t>();
  if (is == was || code) return "";
  return "the log has " + std::to_string(is) + " bytes; the run has left " + std::to_string(was) + " (summary.json)";
}

// The words of `ballast compare`, which knows fields and units.
std::string first_difference(const std::string& log, const std::string& replayed) {
  const auto compare = program::beside_this_program("ballast-compare");
  const program::ProgramOutcome said = program::run_program(
      {compare.string(), "--controller", "--", fs::absolute(log).string(), fs::absolute(replayed).string()});
  if (said.exit_status == 0) return said.output;
  return "  which field it is ballast-compare would say, but: " + said.output + "\n";
}

void print(const ReplayCommand& command, const sim::Scenario& scenario, const std::string& scenario_file,
           const sil::ReplayResult& result, const std::string& replayed, const std::string& damage) {
  std::printf("%s: ticks %" PRId64 " to %" PRId64 " of %s, given to the firmware %s\n", scenario.name.c_str(),
              result.first_tick, result.last_tick, command.log.c_str(),
              command.in_qemu() ? ("in QEMU, on " + qemu_options(command).board).c_str() : "on this machine");
  for (const std::string& note : result.notes) std::printf("  note        %s\n", note.c_str());
  const auto recorded = sil::firmware_sources(file_text(scenario_file));
  const std::string own = sil::own_firmware_sources();
  if (!recorded) {
    std::printf("  firmware    sources %s; of the recorded run's nothing is known\n", own.c_str());
  } else if (*recorded == own) {
    std::printf("  firmware    the sources of the recorded run, %s\n", own.c_str());
  } else {
    std::printf("  firmware    sources %s; the run was recorded with others, %s\n", own.c_str(), recorded->c_str());
  }
  if (result.trip) {
    std::printf("  trip        in tick %lld, faults 0x%x\n", static_cast<long long>(result.trip->tick),
                static_cast<unsigned>(result.trip->faults));
  }
  if (!damage.empty()) std::printf("  DAMAGED     %s\n", damage.c_str());
  if (result.gap) {
    std::printf("  GAP         %s; the log goes on to tick %" PRId64 ", and nothing after tick %" PRId64
                " was replayed\n",
                result.gap->what.c_str(), result.gap->goes_on_to, result.last_tick);
  }
  const bool other_precision = result.recorded_floats && *result.recorded_floats != (command.firmware == kQemuAn386);
  if (other_precision) {
    std::printf(
        "  precision   the log is of a firmware in %s precision, and this one's is %s: replay it with --firmware %s\n",
        *result.recorded_floats ? "single" : "double", *result.recorded_floats ? "double" : "single",
        *result.recorded_floats ? kQemuAn386 : kHost);
  }
  if (!result.first_difference && result.gap) {
    std::printf("  equal       up to the gap: every step command and every status of ticks %" PRId64 " to %" PRId64
                ", bit for bit\n",
                result.first_tick, result.last_tick);
  } else if (!result.first_difference) {
    std::printf("  equal       every step command and every status, bit for bit\n");
  } else {
    std::printf("  DIFFERS     in %" PRId64 " of %" PRId64 " ticks, first in tick %" PRId64 "\n",
                result.ticks_that_differ, result.ticks, *result.first_difference);
    std::fputs(first_difference(command.log, replayed).c_str(), stdout);
    // A log has no checksum: a flipped bit in it is an input, or an output, like any other.
    const char* why = "the firmware's sources, or a damaged log, which looks the same";
    if (recorded == own)
      why =
          "not the firmware's sources, which are the same: the log is damaged, or of another build of them (compiler, "
          "options)";
    if (other_precision) why = "the other precision, above";
    std::printf("  why         %s\n", why);
  }
  std::fflush(stdout);
}

int replay(const ReplayCommand& given) {
  ReplayCommand command = given;
  std::error_code code;
  if (fs::is_directory(command.log, code)) command.log = (fs::path(command.log) / "run.lcmlog").string();
  const sil::LogScenario of_log = sil::scenario_of_log(command.log);
  if (!of_log.id) return could_not(of_log.trouble);

  program::ScenarioOptions options;
  options.scenario =
      command.scenario.empty() ? (fs::path(command.log).parent_path() / "scenario.toml").string() : command.scenario;
  if (command.scenario.empty() && !fs::exists(options.scenario, code)) {
    return refuse(options.scenario + ": no such file, which a run leaves beside its log; name it with --scenario");
  }
  const auto scenario = program::load_scenario(options);
  if (!scenario) return program::kExitUsage;
  if (scenario->id != *of_log.id) {
    return refuse(command.log + " is of another scenario: fingerprint " + std::to_string(*of_log.id) + "; " +
                  options.scenario + " has " + std::to_string(scenario->id) +
                  " (or a build of today understands that file in another way)");
  }
  if (scenario->run.actuation != sim::Actuation::kStepper) {
    return refuse(command.log + ": a run with prescribed masses has no controller to replay; allowed: steppers");
  }
  const auto params = std::make_unique<firmware::ControllerParams>();
  if (const auto refusal = program::to_controller_params(*scenario, *params)) return refuse(*refusal);
  if (!command.out.empty() && fs::exists(command.out, code) && fs::equivalent(command.out, command.log, code)) {
    return refuse("--out: " + command.out + " is the log that is replayed; allowed: another file");
  }

  const TemporaryLog temporary;
  const std::string replayed = command.out.empty() ? temporary.path() : command.out;
  if (replayed.empty()) {
    return could_not("no temporary file can be made; name one with --out");
  }
  command.replay.interrupted = program::catch_signals();
  const monitor::MonitorLimits limits = program::to_monitor_limits(*scenario);
  std::unique_ptr<sil::Peers> peers;
  if (command.in_qemu()) {
    if (const auto why = sil::FaultyPeers::not_possible(*scenario, sil::FaultyPeers::Elsewhere::kNothing,
                                                        "with --firmware " + command.firmware);
        !why.empty()) {
      return refuse(why);
    }
    sil::QemuPeersOptions qemu;
    qemu.qemu = qemu_options(command);
    qemu.interrupted = command.replay.interrupted;
    peers = std::make_unique<sil::QemuPeers>(*scenario, *params, limits, qemu);
  } else {
    peers = sil::peers_in_process(*scenario, params.get(), limits);
  }
  const sil::ReplayResult result = sil::replay(*scenario, command.log, *peers, replayed, command.replay);
  if (result.end == sil::ReplayResult::End::kAskedForNothing) return refuse("--until: " + result.trouble);
  if (result.end == sil::ReplayResult::End::kUnusable) return could_not(result.trouble);
  if (result.end == sil::ReplayResult::End::kFailed) {
    program::complain("ballast", result.trouble);
    return peers->exit_status();
  }
  const std::string damage = length_fault(command.log);
  print(command, *scenario, options.scenario, result, replayed, damage);
  if (command.verify && result.first_difference) return kExitDiffers;
  return command.verify && (result.gap || !damage.empty()) ? kExitGap : program::kExitCompleted;
}

}  // namespace

std::function<int()> add_replay_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("replay",
                               "Gives a recorded run's inputs to the firmware of today, and says where its outputs "
                               "differ from the recorded ones");
  auto options = std::make_shared<ReplayCommand>();
  command->add_option("LOG", options->log, "run.lcmlog, or the folder of the run")
      ->required()
      ->check(program::not_empty());
  command->add_flag("--verify", options->verify,
                    "exit status 3 if anything differs, 8 if the log has a gap or is damaged");
  command->add_option("--until", options->replay.until_tick, "the last tick to replay; default all");
  command->add_option("--scenario", options->scenario, "the run's scenario; default scenario.toml beside the log")
      ->check(program::not_empty());
  add_firmware_options(*command, *options);
  command->add_option("--out", options->out, "keep the replayed log: the recorded one with the replayed outputs in it")
      ->check(program::not_empty());
  return [options] { return replay(*options); };
}

}  // namespace ballast
