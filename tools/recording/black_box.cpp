#include "tools/recording/black_box.h"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "hal/target/build_id.h"
#include "sim/scenario/reader.h"
#include "tools/program/program.h"
#include "tools/summary/summary.h"

namespace ballast::sil {

namespace fs = std::filesystem;

namespace {

constexpr char kSourcesAre[] = "# Firmware sources: ";

std::string absolute_word(const fs::path& path) { return program::shell_word(fs::absolute(path).lexically_normal()); }

// " --mass 1 --to 2.5", as `ballast move` takes it.
std::string move_words(const firmware::MoveRequest& move) {
  std::string text;
  for (std::size_t i = 0; i < move.target_position.size(); ++i) {
    if ((move.masses >> i & 1u) != 0)
      text += " --mass " + std::to_string(i) + " --to " + sim::number_text(move.target_position[i]);
  }
  if (move.speed_fraction != 1) text += " --speed-fraction " + sim::number_text(move.speed_fraction);
  return text;
}

// Copies a file from a byte on. False: errno says why.
bool copy_tail(const fs::path& from, std::int64_t offset, const fs::path& to) {
  std::ifstream in(from, std::ios::binary);
  in.seekg(offset);
  std::ofstream out(to, std::ios::binary);
  char chunk[1 << 16];
  while (in && out && (in.read(chunk, sizeof chunk) || in.gcount() > 0)) out.write(chunk, in.gcount());
  out.close();
  return in.eof() && out.good();
}

}  // namespace

std::string scenario_file(const sim::Scenario& scenario) {
  return "# " + scenario.name + " as it was run, what the command line changed included.\n" + kSourcesAre +
         own_firmware_sources() + "\n\n" + scenario.toml;
}

std::optional<std::string> firmware_sources(const std::string& scenario_file) {
  const std::size_t at = scenario_file.find(kSourcesAre);
  if (at == std::string::npos) return std::nullopt;
  const std::size_t begin = at + std::strlen(kSourcesAre);
  return scenario_file.substr(begin, scenario_file.find('\n', begin) - begin);
}

std::string own_firmware_sources() { return fmt::format("{:016x}", hal::target::kSourcesId); }

bool ended_badly(const RunResult& result) {
  if (result.refusal || result.status == hal::Status::kInterrupted) return false;
  return result.status != hal::Status::kOk || exit_status(result) != 0;
}

std::string Again::text() const {
  if (run.empty()) return replay.empty() ? "" : "; what the controller was told, again: " + replay;
  return "; again: " + run + (replay.empty() ? "" : "\n  only what the controller was told: " + replay);
}

Again again_of(const sim::Scenario& scenario, const RunResult& result, const RunOptions& options,
               const std::string& firmware_options, const std::string& run_options, const OutputDir& output) {
  Again again;
  const std::string ballast = program::ballast_as_typed(true);
  const fs::path box = output.path() / kBlackBox;
  const bool people_spoke = result.operators_heard || options.by_hand;
  if (!people_spoke) {
    again.run = ballast + (options.move ? " move " : " run ") + absolute_word(box / "scenario.toml") +
                (options.move ? move_words(*options.move) : "") + firmware_options + run_options +
                (options.check_steps ? " --check-steps" : "") + " --out " + absolute_word(box / "again");
  }
  const bool has_controller = sim::has_controller(scenario.run.actuation);
  if (has_controller && (people_spoke || result.status != hal::Status::kOk))
    again.replay = ballast + " replay " + absolute_word(output.log_path()) + firmware_options;
  return again;
}

namespace {

bool try_black_box(const sim::Scenario& scenario, const RunResult& result, const Again& again, const Recorder& recorder,
                   OutputDir& output) {
  auto summary = nlohmann::ordered_json::parse(summary_json(scenario, result));
  if (result.status != hal::Status::kOk) {
    summary["end"] = {{"reason", "could_not_go_on"}, {"time", result.final_sample.time_s}, {"text", result.trouble}};
  }
  nlohmann::ordered_json box;
  box["scenario"] = scenario.name;
  box["seed"] = scenario.seed;
  box["firmware_sources"] = own_firmware_sources();
  box["command"] = again.run.empty() ? again.replay : again.run;
  if (!again.run.empty() && !again.replay.empty()) box["replay"] = again.replay;
  box["end"] = summary["end"];
  box["trip"] = summary["trip"];
  box["faults"] = result.controller_trip ? result.controller_trip->faults : 0;
  box["last_tick"] = result.last_tick;
  box["summary"] = std::move(summary);

  if (!output.is_still_there()) return false;
  const fs::path folder = output.path() / kBlackBox;
  std::error_code code;
  fs::create_directory(folder, code);
  if (code) return output.fail(folder.string() + ": cannot be made: " + code.message());
  if (recorder.bytes() > 0 && !copy_tail(output.log_path(), recorder.tail_offset(), folder / "run.lcmlog")) {
    return output.fail((folder / "run.lcmlog").string() + ": cannot be written: " + std::strerror(errno));
  }
  return output.write(std::string(kBlackBox) + "/scenario.toml", scenario_file(scenario)) &&
         output.write(std::string(kBlackBox) + "/blackbox.json", box.dump(2) + "\n");
}

}  // namespace

bool write_black_box(const sim::Scenario& scenario, const RunResult& result, const Again& again,
                     const Recorder& recorder, OutputDir& output) {
  if (try_black_box(scenario, result, again, recorder, output)) return true;
  output.clear_black_box();
  return false;
}

}  // namespace ballast::sil
