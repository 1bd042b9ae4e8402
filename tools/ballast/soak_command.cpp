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
#include "tools/program/count_progress.h"
#include "tools/program/program.h"
#include "tools/recording/output_dir.h"
#include "tools/soak/failure_table.h"
#include "tools/soak/workers.h"

namespace ballast {

namespace {

struct SoakCommand {
  std::string seeds;
  int jobs = 0;
  std::string keep;
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

struct Totals {
  std::uint64_t seeds = 0, broken = 0, faults = 0, faulty = 0, violated = 0;
  std::int64_t simulated_us = 0, ticks = 0, refused = 0;
  std::array<std::uint64_t, soak::kOutcomeCount> outcomes{};

  void add(const soak::SeedResult& result) {
    ++seeds;
    broken += result.broken >= 0;
    faults += static_cast<std::uint64_t>(result.faults);
    faulty += result.faults > 0;
    violated += result.violated;
    simulated_us += result.simulated_us;
    ticks += result.ticks;
    refused += result.refused;
    ++outcomes[static_cast<std::size_t>(result.outcome)];
  }
};

void print_totals(const Totals& totals, double wall_s) {
  const double simulated_s = 1e-6 * static_cast<double>(totals.simulated_us);
  const auto part = [&](std::uint64_t count) {
    return 100.0 * static_cast<double>(count) / static_cast<double>(totals.seeds);
  };
  for (std::size_t i = 0; i < totals.outcomes.size(); ++i) {
    if (totals.outcomes[i] == 0) continue;
    std::cout << fmt::format("  {:<30} {:5.1f} %\n", to_string(static_cast<soak::Outcome>(i)),
                             part(totals.outcomes[i]));
  }
  std::cout << fmt::format("  {:<30} {:5.1f} %\n", "left the envelope", part(totals.violated));
  std::cout << fmt::format("  {:<30} {:5.1f} %, {} faults\n", "with faults", part(totals.faulty), totals.faults);
  std::cout << fmt::format("  {:<30} {} of the scenarios drawn\n", "refused by the check", totals.refused);
  std::cout << fmt::format("{} seed{}, {:.2f} h simulated in {} ticks, {:.4g} s, {:.3g} seeds/s, {} broken\n",
                           totals.seeds, totals.seeds == 1 ? "" : "s", simulated_s / 3600, totals.ticks, wall_s,
                           static_cast<double>(totals.seeds) / wall_s, totals.broken);
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
  std::optional<sil::OutputDir> kept;
  if (!command.keep.empty() && !kept.emplace(command.keep).good()) return could_not("--keep: " + kept->error());

  Totals totals;
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
  if (totals.seeds > 0 && !command.table) print_totals(totals, progress.seconds());
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
  command->add_flag("--table", options->table,
                    "inject one fault into each of many calm robots, and print the effects as a Markdown table");
  command->add_flag("--quiet", options->quiet, "no progress");
  return [options] { return run(*options); };
}

}  // namespace ballast
