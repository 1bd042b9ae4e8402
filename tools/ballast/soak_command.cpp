// ballast soak: runs random scenarios with random faults, and checks the invariants of tools/soak/invariants.h in each.
#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <iostream>
#include <optional>
#include <thread>

#include "sim/scenario/reader.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/soak_totals.h"
#include "tools/program/count_progress.h"
#include "tools/program/program.h"
#include "tools/recording/output_dir.h"
#include "tools/soak/failure_table.h"
#include "tools/soak/workers.h"
#include "tools/sweep/build_record.h"

namespace ballast {

namespace {

struct SoakCommand {
  std::string seeds;
  int jobs = 0;
  std::string keep, add;
  double seed_limit_s = 120;
  bool quiet = false;
  bool table = false;
};

// Parses "A..B", or "A" for one seed.
bool parse_seeds(const std::string& text, soak::WorkerOptions& out) {
  const auto number = [](std::string_view digits, std::uint64_t& value) {
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return error == std::errc{} && end == digits.data() + digits.size() && value < std::uint64_t{1} << 62;
  };
  const std::size_t dots = text.find("..");
  const std::string_view all(text);
  if (!number(all.substr(0, dots), out.first)) return false;
  out.last = out.first;
  if (dots == std::string::npos) return true;
  return number(all.substr(dots + 2), out.last) && out.first <= out.last;
}

// Prints a seed that failed, with the command that repeats it, and keeps its scenario.
void report_broken(const SoakCommand& command, const soak::SeedResult& result, sil::OutputDir* kept) {
  const auto& invariant = soak::text_of(static_cast<soak::Invariant>(result.broken));
  const std::string folder = program::shell_word(command.keep.empty() ? "soak" : command.keep);
  const bool usual_limit = command.seed_limit_s == SoakCommand().seed_limit_s;
  std::cout << fmt::format(
      "seed {0}: \"{1}\" is broken in tick {2}: {3}\n  again: {4} soak{5} --seeds {0}..{0}{6} --keep {7}\n",
      result.seed, invariant.name, result.broken_tick, result.broken_text, program::ballast_as_typed(),
      command.table ? " --table" : "", usual_limit ? "" : " --seed-limit " + sim::number_text(command.seed_limit_s),
      folder);
  if (kept != nullptr) {
    const auto random = command.table ? soak::table_scenario(result.seed) : soak::random_scenario(result.seed);
    if (kept->write(fmt::format("{}.toml", result.seed), random.toml))
      std::cout << fmt::format("  its run: {} run {}/{}.toml\n", program::ballast_as_typed(), folder, result.seed);
  }
  std::cout << std::flush;
}

int run(const SoakCommand& command) {
  soak::WorkerOptions options;
  if (!parse_seeds(command.seeds, options)) {
    return refuse("--seeds " + command.seeds + ": allowed: A..B, whole numbers, 0 <= A <= B < 2^62");
  }
  options.jobs = command.jobs > 0 ? command.jobs : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  options.seed_limit_s = command.seed_limit_s;
  options.interrupted = program::catch_signals();
  const std::uint64_t count = options.last - options.first + 1;
  if (command.table && !command.add.empty())
    return refuse("--add: --table draws other scenarios; allowed: one of them");
  const SeedRange range{options.first, options.last};
  SoakFile all;
  if (!command.add.empty()) {
    const std::string why = read_soak_file(command.add, sweep::this_build(), range, all);
    if (!why.empty()) return refuse(fmt::format("--add: {} {}", command.add, why));
  }
  std::optional<sil::OutputDir> kept;
  if (!command.keep.empty() && !kept.emplace(command.keep).good()) return could_not("--keep: " + kept->error());

  SoakTotals totals;
  soak::FailureTable table;
  program::CountProgress progress(count, "seeds", !command.quiet);
  const auto done = [&](const soak::SeedResult& result) {
    totals.add(result);
    table.add(result);
    if (result.broken < 0) return;
    progress.clear();
    report_broken(command, result, kept ? &*kept : nullptr);
  };
  const auto run_one = [&command](std::uint64_t seed) {
    return command.table ? soak::run_table_seed(seed) : soak::run_seed(seed);
  };
  const std::string why = soak::run_seeds(
      options, run_one, done, [&] { progress.show(totals.seeds, fmt::format("{} broken", totals.broken)); });
  progress.clear();
  if (!why.empty()) return could_not(why);
  if (kept && !kept->good()) return could_not(kept->error());
  if (command.table) std::cout << table.markdown();
  totals.wall_s = progress.seconds();
  if (totals.seeds > 0 && !command.table) std::cout << totals.text();
  if (!command.add.empty() && totals.seeds == count) {
    all.ranges.push_back(range);
    all.totals.add(totals);
    if (!write_soak_file(command.add, all)) return could_not(fmt::format("--add: {}: cannot be written", command.add));
    if (all.ranges.size() > 1) {
      std::cout << fmt::format("\n{}, {} ranges of seeds:\n", command.add, all.ranges.size()) << all.totals.text();
    }
  }
  if (totals.broken > 0) return program::kExitEnvelope;
  return totals.seeds < count ? could_not(fmt::format("interrupted after {} of {} seeds", totals.seeds, count))
                              : program::kExitCompleted;
}

}  // namespace

std::function<int()> add_soak_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("soak", "Runs random scenarios with random faults, and checks invariants in each");
  auto options = std::make_shared<SoakCommand>();
  command->add_option("--seeds", options->seeds, "A..B: the seeds to run, both included")->required();
  command->add_option("--jobs", options->jobs, "runs at a time; default: one per core")
      ->check(program::whole_number(1, 1024));
  command->add_option("--keep", options->keep, "folder in which the scenarios of failed seeds are kept as SEED.toml")
      ->check(program::not_empty());
  command
      ->add_option("--seed-limit", options->seed_limit_s,
                   "s of wall time after which a seed is killed and counts as failed")
      ->check(program::positive_finite())
      ->capture_default_str();
  command
      ->add_option("--add", options->add,
                   "file to which the totals are added; it refuses seeds that it has, and those of another build")
      ->check(program::not_empty());
  command->add_flag("--table", options->table,
                    "inject one fault into each of many calm robots, and print the effects as a Markdown table");
  command->add_flag("--quiet", options->quiet, "no progress");
  return [options] { return run(*options); };
}

}  // namespace ballast
