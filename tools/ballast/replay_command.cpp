// ballast replay: gives the inputs of a recorded run to this build's firmware.
#include <fmt/core.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tools/ballast/commands.h"
#include "tools/ballast/firmware_option.h"
#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/program/subprocess.h"
#include "tools/qemu/qemu_firmware.h"
#include "tools/recording/black_box.h"
#include "tools/recording/record_run.h"
#include "tools/recording/replay.h"

namespace ballast {

namespace {

namespace fs = std::filesystem;

constexpr int kExitDiffers = 3;
constexpr int kExitGap = 8;  // program.h has 4 to 7

struct ReplayCommand : FirmwareOption {
  std::string log;
  std::string scenario;  // empty: scenario.toml beside the log
  std::string out;       // empty: the replayed log is deleted
  sil::ReplayOptions replay;
  bool verify = false;
};

// A temporary file, deleted with the object.
class TemporaryLog {
 public:
  TemporaryLog() {
    // mkdtemp replaces the six X.
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

// Compares the length of the log with that in the run's summary. Empty: they are equal, or there is no summary.
std::string length_fault(const fs::path& log) {
  if (log.filename() != "run.lcmlog") return "";  // a summary beside a log of another name does not belong to it
  std::ifstream file(log.parent_path() / "summary.json");
  const auto summary = nlohmann::json::parse(file, nullptr, false);
  if (!summary.is_object() || !summary.value("log_bytes", nlohmann::json()).is_number_integer()) return "";
  std::error_code code;
  const auto is = static_cast<std::int64_t>(fs::file_size(log, code)), was = summary["log_bytes"].get<std::int64_t>();
  if (is == was || code) return "";
  return fmt::format("the log has {} bytes; the run left {} (summary.json)", is, was);
}

// The first difference in the words of `ballast compare`, which knows fields and units.
std::string first_difference(const std::string& log, const std::string& replayed) {
  const auto compare = program::beside_this_program("ballast-compare");
  const program::ProgramOutcome compared = program::run_program(
      {compare.string(), "--controller", "--", fs::absolute(log).string(), fs::absolute(replayed).string()});
  if (compared.exit_status == 0) return compared.output;
  return fmt::format("  ballast-compare, which names the field, failed: {}\n", compared.output);
}

std::string sources_text(const std::optional<std::string>& recorded, const std::string& own) {
  if (!recorded) return fmt::format("  firmware    sources {}; those of the recorded run are not known\n", own);
  if (*recorded == own) return fmt::format("  firmware    the sources of the recorded run, {}\n", own);
  return fmt::format("  firmware    sources {}; the run was recorded with others, {}\n", own, *recorded);
}

std::string difference_text(const ReplayCommand& command, const sil::ReplayResult& result, const std::string& replayed,
                            bool same_sources, bool other_precision) {
  // A log has no checksum, so a flipped bit in it cannot be told from an input or an output.
  const char* why = "the firmware's sources, or a damaged log, which looks the same";
  if (same_sources) {
    why =
        "not the firmware's sources, which are the same: the log is damaged, or of another build of them (compiler, "
        "options)";
  }
  if (other_precision) why = "the other precision, above";
  return fmt::format("  DIFFERS     in {} of {} ticks, first in tick {}\n{}  why         {}\n",
                     result.ticks_that_differ, result.ticks, *result.first_difference,
                     first_difference(command.log, replayed), why);
}

void print(const ReplayCommand& command, const sim::Scenario& scenario, const std::string& scenario_file,
           const sil::ReplayResult& result, const std::string& replayed, const std::string& damage) {
  std::cout << fmt::format("{}: ticks {} to {} of {}, given to the firmware {}\n", scenario.name, result.first_tick,
                           result.last_tick, command.log,
                           command.in_qemu() ? "in QEMU, on " + qemu_options(command).board : "on this machine");
  for (const std::string& note : result.notes) std::cout << fmt::format("  note        {}\n", note);
  const auto recorded = sil::firmware_sources(file_text(scenario_file));
  const std::string own = sil::own_firmware_sources();
  std::cout << sources_text(recorded, own);
  if (result.trip) {
    std::cout << fmt::format("  trip        in tick {}, faults {:#x}\n", result.trip->tick,
                             static_cast<std::uint32_t>(result.trip->faults));
  }
  if (!damage.empty()) std::cout << fmt::format("  DAMAGED     {}\n", damage);
  if (result.gap) {
    std::cout << fmt::format("  GAP         {}; the log goes on to tick {}, and nothing after tick {} was replayed\n",
                             result.gap->what, result.gap->goes_on_to, result.last_tick);
  }
  const bool other_precision = result.recorded_floats && *result.recorded_floats != (command.firmware == kQemuAn386);
  if (other_precision) {
    std::cout << fmt::format(
        "  precision   the log is of a firmware in {} precision, and this one's is {}: replay it with --firmware {}\n",
        *result.recorded_floats ? "single" : "double", *result.recorded_floats ? "double" : "single",
        *result.recorded_floats ? kQemuAn386 : kHost);
  }
  if (result.misjudged) {
    std::cout << fmt::format("  WRONG       in {} of {} ticks, first in tick {}: {}\n", result.ticks_misjudged,
                             result.ticks, result.misjudged->tick, result.misjudged->text);
  } else if (command.verify) {
    std::cout << "  judged      the monitor's verdicts and the plant's messages, again: nothing wrong\n";
  }
  if (result.first_difference) {
    std::cout << difference_text(command, result, replayed, recorded == own, other_precision);
  } else if (result.gap) {
    std::cout << fmt::format(
        "  equal       up to the gap: every step command and every status of ticks {} to {}, bit for bit\n",
        result.first_tick, result.last_tick);
  } else {
    std::cout << "  equal       every step command and every status, bit for bit\n";
  }
  std::cout << std::flush;
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
    return refuse(options.scenario + ": no such file; a run leaves it beside its log; name it with --scenario");
  }
  const auto scenario = program::load_scenario(options);
  if (!scenario) return program::kExitUsage;
  if (scenario->id != *of_log.id) {
    return refuse(
        fmt::format("{} is of another scenario: fingerprint {}; {} has {} (or this build reads that file "
                    "differently)",
                    command.log, *of_log.id, options.scenario, scenario->id));
  }
  if (!sim::has_controller(scenario->run.actuation)) {
    return refuse(command.log + ": a run with prescribed masses has no controller to replay; allowed: steppers");
  }
  const auto params = program::make_controller_params("ballast", *scenario);
  if (!params) return program::kExitUsage;
  if (!command.out.empty() && fs::exists(command.out, code) && fs::equivalent(command.out, command.log, code)) {
    return refuse("--out: " + command.out + " is the log that is replayed; allowed: another file");
  }

  const TemporaryLog temporary;
  const std::string replayed = command.out.empty() ? temporary.path() : command.out;
  if (replayed.empty()) {
    return could_not("no temporary file can be made; name one with --out");
  }
  command.replay.interrupted = program::catch_signals();
  std::unique_ptr<sil::Peer> firmware;
  if (command.in_qemu()) {
    if (const auto why =
            sil::cannot_inject(*scenario, sil::PeersAre::kOutOfReach, "with --firmware " + command.firmware);
        !why.empty()) {
      return refuse(why);
    }
    sil::QemuFirmwareOptions qemu;
    qemu.qemu = qemu_options(command);
    qemu.interrupted = command.replay.interrupted;
    firmware = std::make_unique<sil::QemuFirmware>(*scenario, *params, qemu);
  } else {
    sil::ReplayedFirmware replayed_firmware = sil::firmware_for_replay(*scenario, *params);
    firmware = std::move(replayed_firmware.peer);
    command.replay.before_tick = std::move(replayed_firmware.before_tick);
  }
  if (command.verify) command.replay.judge = program::to_monitor_limits(*scenario);
  const sil::ReplayResult result = sil::replay(*scenario, command.log, *firmware, replayed, command.replay);
  if (result.end == sil::ReplayResult::End::kAskedForNothing) return refuse("--until: " + result.trouble);
  if (result.end == sil::ReplayResult::End::kUnusable) return could_not(result.trouble);
  if (result.end == sil::ReplayResult::End::kFailed) {
    program::complain("ballast", result.trouble);
    return sil::exit_status(firmware->failure());
  }
  const std::string damage = length_fault(command.log);
  print(command, *scenario, options.scenario, result, replayed, damage);
  if (command.verify && (result.first_difference || result.misjudged)) return kExitDiffers;
  return command.verify && (result.gap || !damage.empty()) ? kExitGap : program::kExitCompleted;
}

}  // namespace

std::function<int()> add_replay_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("replay",
                               "Gives a recorded run's inputs to this build's firmware, and prints where its outputs "
                               "differ from the recorded ones");
  auto options = std::make_shared<ReplayCommand>();
  command->add_option("LOG", options->log, "run.lcmlog, or the folder of the run")
      ->required()
      ->check(program::not_empty());
  command->add_flag("--verify", options->verify,
                    "judge verdicts and the plant's messages again; exit status 3 if anything differs or is wrong, 8 "
                    "if the log has a gap or is damaged");
  command->add_option("--until", options->replay.until_tick, "the last tick to replay; default: all");
  command->add_option("--scenario", options->scenario, "the run's scenario; default scenario.toml beside the log")
      ->check(program::not_empty());
  add_firmware_options(*command, *options);
  command->add_option("--out", options->out, "keep the replayed log: the recorded log with the replayed outputs")
      ->check(program::not_empty());
  return [options] { return replay(*options); };
}

}  // namespace ballast
