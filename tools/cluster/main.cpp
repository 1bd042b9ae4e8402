// ballast-sweep: `ballast sweep` on the ranks of an MPI program. Rank 0 reads the sweep, prepares the folder, hands out
// blocks and writes the results; every rank computes blocks and writes them into the folder, which all nodes share.
#include <fmt/format.h>
#include <mpi.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <filesystem>
#include <iostream>

#include "tools/cluster/block_queue.h"
#include "tools/cluster/crash_notice.h"
#include "tools/program/count_progress.h"
#include "tools/program/program.h"
#include "tools/sweep/completion.h"
#include "tools/sweep/limit_search.h"
#include "tools/sweep/read_spec.h"
#include "tools/sweep/workers.h"

namespace ballast {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct Command {
  std::string sweep, out, find_limit;
  bool resume = false, quiet = false;
};

// Rank 0's message to all others before the first block.
struct Start {
  std::uint64_t sweep = 0;  // its identity
  bool go = false;          // false: there is nothing to compute
  char folder[4000] = {};
};

int fail(int status, const std::string& text) {
  program::complain("ballast-sweep", text);
  return status;
}

std::optional<sweep::Spec> load(const Command& command) {
  std::vector<sim::ScenarioError> errors;
  auto spec = sweep::read_spec(command.sweep, errors);
  for (const sim::ScenarioError& error : errors) std::cerr << sim::to_string(error) << '\n';
  if (!spec || command.find_limit.empty()) return spec;
  const std::string why = sweep::limit_refusal(*spec, command.find_limit);
  if (why.empty()) {
    spec->find_limit = command.find_limit;
    return spec;
  }
  fail(0, "--find-limit " + command.find_limit + ": " + why);
  return std::nullopt;
}

void tell(Start& start) { MPI_Bcast(&start, sizeof start, MPI_BYTE, 0, MPI_COMM_WORLD); }

// Rank 0 of a sweep whose folder is ready.
class Master {
 public:
  Master(const Command& command, const sweep::Spec& spec, const fs::path& folder, int ranks)
      : spec_(spec),
        folder_(folder),
        plan_(spec),
        work_(sweep::work_of(plan_, folder, {})),
        queue_(work_.blocks, ranks),
        progress_(work_.rows, "runs", !command.quiet, work_.rows_before),
        interrupted_(program::catch_signals()) {}

  // Empty, or why not all rows are there.
  std::string compute() {
    const sweep::RowScenarios scenarios(spec_);
    sweep::RowRunner runner(spec_, scenarios);
    runner.set_beginning(cluster::set_rows_at_work);
    while (const auto block = queue_.take()) {
      const std::string why = sweep::run_block(runner, plan_, folder_, *block, [this](const sweep::RowResult& row) {
        ++own_.rows;
        if (row.held()) ++own_.held;
        look();
        return *interrupted_ == 0;
      });
      if (!why.empty()) queue_.stop(why);
    }
    while (!queue_.ended()) {
      look();
      cluster::rest();
    }
    progress_.clear();
    if (!queue_.trouble().empty()) return queue_.trouble() + "; the finished blocks are kept, and --resume continues";
    if (rows() < work_.rows)
      return fmt::format("interrupted after {} of {} runs; --resume continues", rows(), work_.rows);
    return "";
  }

  [[nodiscard]] std::uint64_t messages() const { return queue_.messages(); }
  [[nodiscard]] std::size_t blocks() const { return work_.blocks.size(); }
  [[nodiscard]] const sweep::BlockPlan& plan() const { return plan_; }

 private:
  [[nodiscard]] std::uint64_t rows() const { return work_.rows_before + own_.rows + queue_.done().rows; }

  // Answers other ranks, at most a thousand times a second.
  void look() {
    const auto now = Clock::now();
    if (now < next_look_) return;
    next_look_ = now + std::chrono::milliseconds(1);
    if (*interrupted_ != 0) queue_.stop("");
    queue_.serve();
    const double held = static_cast<double>(work_.held_before + own_.held + queue_.done().held);
    progress_.show(rows(),
                   fmt::format("{:.3g} % hold", 100 * held / static_cast<double>(std::max<std::uint64_t>(rows(), 1))));
  }

  const sweep::Spec& spec_;
  fs::path folder_;
  sweep::BlockPlan plan_;
  sweep::Work work_;
  cluster::BlockQueue queue_;
  cluster::Done own_;
  program::CountProgress progress_;
  const volatile std::sig_atomic_t* interrupted_;
  Clock::time_point next_look_ = Clock::now();
};

// Rank 0 after the command line. Calls MPI_Finalize in between, since no other rank takes part in what follows.
int lead(const Command& command, int ranks) {
  Start start;
  const auto leave = [&start](int status) {
    tell(start);
    MPI_Finalize();
    return status;
  };
  const auto spec = load(command);
  if (!spec) return leave(program::kExitUsage);
  sil::OutputDir output(command.out.empty() ? "runs/" + spec->name : command.out);
  if (!output.good()) return leave(fail(program::kExitCouldNotRun, output.error()));
  if (const auto why = sweep::folder_refusal(output.path(), *spec, command.resume); !why.empty())
    return leave(fail(program::kExitUsage, why));
  const bool complete = sweep::content_of(output.path(), *spec) == sweep::FolderHolds::kItsResults;
  std::string ranks_text = "the results were complete";
  if (complete && command.resume) {
    static_cast<void>(leave(0));
  } else {
    if (const auto why = sweep::begin_work(output, *spec); !why.empty())
      return leave(fail(program::kExitCouldNotRun, why));
    const std::string folder = fs::absolute(output.path()).string();
    start.sweep = sweep::identity(*spec);
    start.go = folder.size() < sizeof start.folder;
    start.folder[folder.copy(start.folder, sizeof start.folder - 1)] = '\0';
    tell(start);
    if (!start.go) return fail(program::kExitCouldNotRun, folder + ": the name is too long");
    Master master(command, *spec, output.path(), ranks);
    const std::string why = master.compute();
    MPI_Finalize();
    if (!why.empty()) return fail(program::kExitCouldNotRun, why);
    ranks_text = fmt::format("{} ranks, {} blocks, {} messages", ranks, master.blocks(), master.messages());
    const std::string unwritten = sweep::write_all(
        output, *spec, [&](std::uint64_t block) { return sweep::read_block_of(output.path(), master.plan(), block); });
    if (!unwritten.empty())
      return fail(program::kExitCouldNotRun, unwritten + "; the blocks are kept, and --resume continues");
  }
  std::string error;
  const std::string page = sweep::summarise(output, *spec, error);
  if (!error.empty()) return fail(program::kExitCouldNotRun, error);
  std::cout << page << fmt::format("  {:<22} {}\n", "results", sweep::results_file(output.path()).string())
            << fmt::format("  {:<22} {}\n", "computed by", ranks_text);
  return program::after_output("ballast-sweep", program::kExitCompleted);
}

// A rank that is not 0.
void follow(int rank) {
  Start start;
  tell(start);
  if (!start.go) return;
  const auto* interrupted = program::catch_signals();
  const fs::path folder = start.folder;
  std::vector<sim::ScenarioError> errors;
  const auto spec = sweep::read_spec(folder / "sweep.toml", errors);
  if (!spec || sweep::identity(*spec) != start.sweep)
    return cluster::report_trouble(fmt::format(
        "rank {}: {} is not what rank 0 has written; allowed: a folder that all nodes share", rank, folder.string()));
  const sweep::BlockPlan plan(*spec);
  const sweep::RowScenarios scenarios(*spec);
  sweep::RowRunner runner(*spec, scenarios);
  runner.set_beginning(cluster::set_rows_at_work);
  cluster::compute_blocks(
      [&](std::uint64_t block, cluster::Done& done) {
        const std::string why = sweep::run_block(runner, plan, folder, block, [&](const sweep::RowResult& row) {
          ++done.rows;
          if (row.held()) ++done.held;
          return *interrupted == 0;
        });
        return why.empty() ? why : fmt::format("rank {}: {}", rank, why);
      },
      [interrupted] { return *interrupted != 0; });
}

// The command line of rank 0. With a value, the program ends with this status.
std::optional<int> read_command(int argc, char** argv, Command& command) {
  CLI::App app("Runs a scenario many times with varied values, on the ranks of an MPI program", "ballast-sweep");
  app.add_option("sweep", command.sweep, "the sweep, a TOML file")->required()->check(program::not_empty());
  app.add_option("--out", command.out, "folder for the results, shared by all nodes; default runs/NAME")
      ->check(program::not_empty());
  app.add_flag("--resume", command.resume, "continue in a folder with finished blocks of this sweep");
  app.add_option("--find-limit", command.find_limit, "search the limit of this key in every row")
      ->check(program::not_empty());
  app.add_flag("--quiet", command.quiet, "no progress");
  return program::parse(app, argc, argv);
}

int run(int argc, char** argv) {
  MPI_Init(&argc, &argv);
  int rank = 0, ranks = 1;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  cluster::announce_crashes(rank);
  if (rank != 0) {
    follow(rank);
    MPI_Finalize();
    return 0;
  }
  Command command;
  if (const auto status = read_command(argc, argv, command)) {
    Start start;
    tell(start);
    MPI_Finalize();
    return *status;
  }
  return lead(command, ranks);
}

}  // namespace
}  // namespace ballast

int main(int argc, char** argv) { return ballast::run(argc, argv); }
