// ballast soak: random scenarios with random faults, each held to the invariants of tools/soak/invariants.h.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cinttypes>
#include <cstdio>
#include <optional>
#include <thread>

#include "sim/scenario/reader.h"
#include "tools/ballast/commands.h"
#include "tools/program/program.h"
#include "tools/recording/output_dir.h"
#include "tools/soak/failure_table.h"
#include "tools/soak/workers.h"

namespace ballast {

namespace {

using Clock = std::chrono::steady_clock;

struct SoakCommand {
  std::string seeds;
  int jobs = 0;
  std::string keep;
  double seed_limit_s = 120;
  bool quiet = false;
  bool table = false;
};

int fail(const std::string& text) {
  program::complain("ballast", text);
  return program::kExitCouldNotRun;
}

// "A..B", or "A" for that one.
bool parse_seeds(const std::string& text, soak::WorkerOptions& out) {
  const auto number = [](std::string_view digits, std::uint64_t& value) {
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return error == std::errc{} && end == digits.data() + digits.size() && value < std::uint64_t{1} << 62;
  };
  const std::size_t dots = text.find("..");
  const std::string_view all(text);
  if (!number(all.substr(0, dots), out.first)) return false;
  if (dots == std::string::npos) return out.last = out.first, true;
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

// A bar on a terminal, else a line every ten seconds.
class Progress {
 public:
  Progress(std::uint64_t count, bool wanted)
      : count_(count), wanted_(wanted), terminal_(isatty(STDERR_FILENO) == 1), begun_(Clock::now()), next_(begun_) {
    if (!terminal_) next_ += std::chrono::seconds(10);
  }
  void show(const Totals& totals) {
    const auto now = Clock::now();
    if (!wanted_ || now < next_) return;
    next_ = now + (terminal_ ? std::chrono::milliseconds(200) : std::chrono::milliseconds(10000));
    const double part = static_cast<double>(totals.seeds) / static_cast<double>(count_), passed_s = seconds();
    constexpr int kWidth = 40;
    std::string bar(kWidth, '.');
    std::fill_n(bar.begin(), static_cast<int>(part * kWidth), '#');
    std::fprintf(stderr, "%s[%s] %3.0f %%  %" PRIu64 " of %" PRIu64 " seeds, %.3g/s, %.0f s left, %" PRIu64 " broken%s",
                 terminal_ ? "\r\033[K" : "", bar.c_str(), 100 * part, totals.seeds, count_,
                 static_cast<double>(totals.seeds) / passed_s, part > 0 ? passed_s * (1 / part - 1) : 0.0,
                 totals.broken, terminal_ ? "" : "\n");
    drawn_ = terminal_;
  }
  void clear() {
    if (drawn_) std::fprintf(stderr, "\r\033[K");
    drawn_ = false;
  }
  [[nodiscard]] double seconds() const { return std::chrono::duration<double>(Clock::now() - begun_).count(); }

 private:
  std::uint64_t count_;
  bool wanted_, terminal_, drawn_ = false;
  Clock::time_point begun_, next_;
};

void print_totals(const Totals& totals, double wall_s) {
  const double simulated_s = 1e-6 * static_cast<double>(totals.simulated_us);
  const auto part = [&](std::uint64_t count) {
    return 100.0 * static_cast<double>(count) / static_cast<double>(totals.seeds);
  };
  for (std::size_t i = 0; i < totals.outcomes.size(); ++i) {
    if (totals.outcomes[i] == 0) continue;
    std::printf("  %-30s %5.1f %%\n", to_string(static_cast<soak::Outcome>(i)), part(totals.outcomes[i]));
  }
  std::printf("  %-30s %5.1f %%\n", "left the envelope", part(totals.violated));
  std::printf("  %-30s %5.1f %%, %" PRIu64 " faults\n", "with faults", part(totals.faulty), totals.faults);
  std::printf("  %-30s %" PRId64 " of the scenarios drawn\n", "refused by the check", totals.refused);
  std::printf("%" PRIu64 " seed%s, %.2f h simulated in %" PRId64 " ticks, %.4g s, %.3g seeds/s, %" PRIu64 " broken\n",
              totals.seeds, totals.seeds == 1 ? "" : "s", simulated_s / 3600, totals.ticks, wall_s,
              static_cast<double>(totals.seeds) / wall_s, totals.broken);
}

int run(const SoakCommand& command) {
  soak::WorkerOptions options;
  if (!parse_seeds(command.seeds, options)) {
    program::complain("ballast", "--seeds " + command.seeds + ": allowed: A..B, whole numbers, 0 <= A <= B < 2^62");
    return program::kExitUsage;
  }
  options.jobs = command.jobs > 0 ? command.jobs : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  options.seed_limit_s = command.seed_limit_s;
  options.interrupted = program::catch_signals();
  const std::uint64_t count = options.last - options.first + 1;
  std::optional<sil::OutputDir> kept;
  if (!command.keep.empty() && !kept.emplace(command.keep).good()) return fail("--keep: " + kept->error());

  Totals totals;
  soak::FailureTable table;
  Progress progress(count, !command.quiet);
  const auto done = [&](const soak::SeedResult& result) {
    totals.add(result);
    table.add(result);
    if (result.broken < 0) return;
    progress.clear();
    const auto& invariant = soak::text_of(static_cast<soak::Invariant>(result.broken));
    const std::string seed = std::to_string(result.seed);
    const std::string folder = program::shell_word(command.keep.empty() ? "soak" : command.keep);
    const double limit_s = command.seed_limit_s;
    std::printf("seed %s: \"%s\" is broken in tick %" PRId64 ": %s\n  again: %s soak%s --seeds %s..%s%s --keep %s\n",
                seed.c_str(), invariant.name, result.broken_tick, result.broken_text,
                program::ballast_as_typed().c_str(), command.table ? " --table" : "", seed.c_str(), seed.c_str(),
                limit_s == SoakCommand().seed_limit_s ? "" : (" --seed-limit " + sim::number_text(limit_s)).c_str(),
                folder.c_str());
    if (kept) {
      const auto random = command.table ? soak::table_scenario(result.seed) : soak::random_scenario(result.seed);
      if (kept->write(seed + ".toml", random.toml))
        std::printf("  its run: %s run %s/%s.toml\n", program::ballast_as_typed().c_str(), folder.c_str(),
                    seed.c_str());
    }
    std::fflush(stdout);
  };
  const std::string why = soak::run_seeds(options, command.table ? soak::run_table_seed : soak::run_seed, done,
                                          [&] { progress.show(totals); });
  progress.clear();
  if (!why.empty()) return fail(why);
  if (kept && !kept->good()) return fail(kept->error());
  if (command.table) std::printf("%s", table.markdown().c_str());
  if (totals.seeds > 0 && !command.table) print_totals(totals, progress.seconds());
  if (totals.broken > 0) return program::kExitEnvelope;
  return totals.seeds < count
             ? fail("interrupted after " + std::to_string(totals.seeds) + " of " + std::to_string(count) + " seeds")
             : program::kExitCompleted;
}

}  // namespace

std::function<int()> add_soak_command(CLI::App& app, CLI::App*& command) {
  command =
      app.add_subcommand("soak", "Runs random scenarios with random faults, and holds each to what must always hold");
  auto options = std::make_shared<SoakCommand>();
  command->add_option("--seeds", options->seeds, "A..B: the seeds to run, both included")->required();
  command->add_option("--jobs", options->jobs, "runs at a time; default: one per core")->check(CLI::Range(1, 1024));
  command->add_option("--keep", options->keep, "folder for the scenarios of seeds that fail, SEED.toml")
      ->check(program::not_empty());
  command->add_option("--seed-limit", options->seed_limit_s, "s on the clock after which a seed has failed")
      ->check(program::positive_finite())
      ->capture_default_str();
  command->add_flag("--table", options->table,
                    "calm robots that suffer one fault each, and what came of it as a table in Markdown");
  command->add_flag("--quiet", options->quiet, "no progress");
  return [options] { return run(*options); };
}

}  // namespace ballast
