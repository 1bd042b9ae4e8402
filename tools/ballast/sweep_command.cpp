// ballast sweep: runs a scenario many times with varied values, and keeps a row of results for each run.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iostream>
#include <limits>
#include <optional>
#include <sstream>
#include <thread>

#include "tools/ballast/commands.h"
#include "tools/program/count_progress.h"
#include "tools/program/program.h"
#include "tools/program/subprocess.h"
#include "tools/sweep/build_record.h"
#include "tools/sweep/completion.h"
#include "tools/sweep/errors_option.h"
#include "tools/sweep/held_map.h"
#include "tools/sweep/limit_search.h"
#include "tools/sweep/read_spec.h"
#include "tools/sweep/results.h"
#include "tools/sweep/summary_page.h"
#include "tools/sweep/workers.h"

namespace ballast {
namespace {

namespace fs = std::filesystem;

struct SweepCommand {
  std::string sweep;
  std::string out;
  int jobs = 0;
  std::string shard;
  bool resume = false;
  std::vector<std::string> merge;
  std::string row;
  std::string find_limit;
  std::string map;
  std::string errors;
  std::uint64_t runs = 1000, seed = 0;  // of --errors
  bool quiet = false;
};

// Parses a whole number.
bool parse_number(std::string_view text, std::uint64_t& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc{} && end == text.data() + text.size() && value < sweep::kMostRuns;
}

// Parses "K/N".
bool parse_shard(const std::string& text, sweep::Shard& shard) {
  const std::size_t slash = text.find('/');
  return slash != std::string::npos && parse_number(std::string_view(text).substr(0, slash), shard.number) &&
         parse_number(std::string_view(text).substr(slash + 1), shard.count) && shard.number >= 1 &&
         shard.number <= shard.count;
}

std::optional<sweep::Spec> load_sweep(const fs::path& file) {
  std::vector<sim::ScenarioError> errors;
  auto spec = sweep::read_spec(file, errors);
  for (const sim::ScenarioError& error : errors) std::cerr << sim::to_string(error) << '\n';
  return spec;
}

// Whether a file in place of a scenario is a sweep.
bool is_a_sweep(const std::string& file) {
  sim::Node tree;
  std::vector<sim::ScenarioError> ignored;
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return sim::read_tree(text.str(), file, tree, ignored) && tree.find("scenario") != nullptr;
}

// The sweep of a scenario with errors.
std::optional<sweep::Spec> load_errors(const SweepCommand& command) {
  std::string why;
  const std::string file = program::scenario_file(command.sweep, why);
  std::vector<sim::ScenarioError> errors;
  std::optional<sweep::Spec> spec;
  if (file.empty())
    std::cerr << why << '\n';
  else if (is_a_sweep(file))
    std::cerr << file << ": is a sweep; allowed: a scenario with --errors, or a sweep without\n";
  else
    spec = sweep::errors_sweep(file, command.errors, command.runs, command.seed, errors);
  for (const sim::ScenarioError& error : errors) std::cerr << sim::to_string(error) << '\n';
  return spec;
}

// Writes map.json of complete results, and draws it. Empty, or what could not be done.
std::string draw_map(const SweepCommand& command, const sweep::Spec& spec, sil::OutputDir& output) {
  std::string error;
  const auto keys = sweep::map_keys(spec, command.map, error);
  if (!error.empty()) return error;
  const std::string json = sweep::held_map_json(sweep::results_file(output.path()).string(), spec, keys, error);
  if (!error.empty()) return error;
  if (!output.write("map.json", json)) return output.error();
  const fs::path folder = fs::absolute(output.path());
  program::Subprocess drawer;
  const auto not_started = drawer.start(
      {.arguments = {program::beside_this_program("ballast-sweep-map"), folder / "map.json", folder / "map.png"}});
  if (not_started || drawer.wait().exit_status != 0)
    return (output.path() / "map.png").string() + ": could not be drawn; map.json and the results are complete";
  std::cout << fmt::format("  {:<22} {}\n", "map", (output.path() / "map.png").string());
  return "";
}

// Completes a folder with results, and prints their summary.
int summarise(const SweepCommand& command, const sweep::Spec& spec, sil::OutputDir& output) {
  const std::string file = sweep::results_file(output.path()).string();
  std::string error;
  const std::string page = sweep::summarise(output, spec, error);
  if (!error.empty()) return could_not(error);
  std::cout << page << fmt::format("  {:<22} {}\n", "results", file);
  if (!command.map.empty()) {
    if (const std::string why = draw_map(command, spec, output); !why.empty()) return could_not(why);
  }
  if (command.errors.empty()) return program::kExitCompleted;
  const std::string sentence = sweep::robustness_sentence(file, spec, error);
  if (!error.empty()) return could_not(error);
  std::cout << fmt::format("With errors of {} {} {}.\n", command.errors, spec.base_name, sentence);
  return program::kExitCompleted;
}

// Writes sweep.nc from all blocks. `kept`: what an error has left.
int finish(const SweepCommand& command, const sweep::Spec& spec, sil::OutputDir& output, const std::string& kept,
           const sweep::TakeBlock& take_block) {
  if (const std::string error = sweep::write_all(output, spec, take_block); !error.empty())
    return could_not(error + "; " + kept);
  return summarise(command, spec, output);
}

int run_sweep(const SweepCommand& command, const sweep::Spec& spec, const sweep::Shard& shard) {
  const auto* interrupted = program::catch_signals();
  const bool sharded = !command.shard.empty();
  std::string folder = command.out.empty() ? "runs/" + spec.name : command.out;
  if (command.out.empty() && sharded) folder += fmt::format("_shard_{}_of_{}", shard.number, shard.count);
  sil::OutputDir output(folder);
  if (!output.good()) return could_not(output.error());
  if (const auto why = sweep::folder_refusal(output.path(), spec, command.resume); !why.empty()) return refuse(why);
  const bool complete = sweep::content_of(output.path(), spec) == sweep::FolderHolds::kItsResults;
  if (complete && sharded)
    return refuse(folder + ": holds complete results of this sweep, which need no shard; allowed: another --out");
  if (complete && command.resume) return summarise(command, spec, output);
  if (const auto why = sweep::begin_work(output, spec); !why.empty()) return could_not(why);

  const sweep::BlockPlan plan(spec);
  const sweep::Work work = sweep::work_of(plan, output.path(), shard);
  program::CountProgress progress(work.rows, "runs", !command.quiet, work.rows_before);
  sweep::WorkOptions options;
  options.jobs = command.jobs > 0 ? command.jobs : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  options.folder = output.path();
  options.interrupted = interrupted;
  sweep::WorkDone done{work.rows_before, work.held_before};
  const std::string why = sweep::run_blocks(spec, work.blocks, options, [&](const sweep::WorkDone& now) {
    done = {work.rows_before + now.rows, work.held_before + now.held};
    const double held = static_cast<double>(done.held) / static_cast<double>(std::max<std::uint64_t>(done.rows, 1));
    progress.show(done.rows, fmt::format("{:.3g} % hold", 100 * held));
  });
  progress.clear();
  if (!why.empty()) return could_not(why + "; the finished blocks are kept, and --resume continues");
  if (done.rows < work.rows)
    return could_not(fmt::format("interrupted after {} of {} runs; --resume continues", done.rows, work.rows));
  if (sharded) {
    std::cout << fmt::format("{}: shard {} of {}, {} of {} runs\n  join all shards with: {} sweep --merge {} ...\n",
                             spec.name, shard.number, shard.count, work.rows, plan.rows(), program::ballast_as_typed(),
                             program::shell_word(folder));
    return program::kExitCompleted;
  }
  return finish(command, spec, output, "the blocks are kept, and --resume continues",
                [&](std::uint64_t block) { return sweep::read_block_of(output.path(), plan, block); });
}

// Empty, or why the results will have no such map.
std::string map_refusal(const SweepCommand& command, const sweep::Spec& spec) {
  if (command.map.empty()) return "";
  if (!command.shard.empty()) return "--map: a shard has no map; allowed: with --merge, or without --shard";
  std::string why;
  static_cast<void>(sweep::map_keys(spec, command.map, why));
  return why.empty() ? "" : fmt::format("--map {}: {}", command.map, why);
}

int merge(const SweepCommand& command) {
  const auto spec = load_sweep(fs::path(command.merge.front()) / "sweep.toml");
  if (!spec) return program::kExitUsage;
  if (const auto why = map_refusal(command, *spec); !why.empty()) return refuse(why);
  for (const std::string& folder : command.merge) {
    const sweep::FolderHolds holds = sweep::content_of(folder, *spec);
    const std::string build = sweep::recorded_build(folder), first = sweep::recorded_build(command.merge.front());
    if (holds == sweep::FolderHolds::kThisSweep && build != first)
      return refuse(fmt::format("{}: was computed by {}, but {} by {}; allowed: shards of one build", folder, build,
                                command.merge.front(), first));
    if (holds == sweep::FolderHolds::kThisSweep) continue;
    if (!fs::is_directory(folder)) return refuse(folder + ": no such folder; allowed: the folders of all shards");
    if (holds == sweep::FolderHolds::kItsResults)
      return refuse(folder + ": holds complete results already, which need no merging");
    return refuse(folder + ": holds no shard of the sweep in " + command.merge.front() +
                  "; allowed: folders of one sweep with --shard");
  }
  sil::OutputDir output(command.out.empty() ? "runs/" + spec->name : command.out);
  if (!output.good()) return could_not(output.error());
  if (sweep::content_of(output.path(), *spec) == sweep::FolderHolds::kOther)
    return refuse(sweep::folder_refusal(output.path(), *spec, true));
  sweep::remove_drafts(output.path());
  if (!sweep::begin_folder(output, *spec)) return could_not(output.error());
  const sweep::BlockPlan plan(*spec);
  const std::string kept = "the shards are unchanged; allowed: the folders of all of them";
  return finish(command, *spec, output, kept, [&](std::uint64_t number) {
    std::optional<sweep::Block> block;
    for (const std::string& folder : command.merge) {
      if (!block) block = sweep::read_block_of(folder, plan, number);
    }
    return block;
  });
}

// The row's values. A searched one has the value of its results, which the search finds again.
sweep::Row row_to_run(const sweep::Spec& spec, std::uint64_t number) {
  sweep::Row row = sweep::make_row(spec, number);
  if (spec.find_limit.empty()) return row;
  const sweep::RowScenarios scenarios(spec);
  sweep::RowRunner(spec, scenarios).run(number, 1, [&](const sweep::RowResult& result) {
    for (std::size_t i = 0; i < row.values.size(); ++i) {
      if (spec.vary[i].key == spec.find_limit) row.values[i] = sweep::number_node(std::get<double>(result.varied[i]));
    }
    return true;
  });
  return row;
}

// Writes the row's scenario beside the results' folder, and becomes `ballast run` of it.
int run_row_again(const SweepCommand& command, const sweep::Spec& spec) {
  std::uint64_t number = 0;
  if (!parse_number(command.row, number) || number >= spec.rows())
    return refuse(fmt::format("--row {}: is no row; allowed: 0 to {}", command.row, spec.rows() - 1));
  const std::string folder = command.out.empty() ? fmt::format("runs/{}_row_{}", spec.name, number) : command.out;
  if (fs::exists(fs::path(folder) / "sweep.toml"))
    return refuse(folder + ": holds a sweep, whose scenario the row's run would replace; allowed: another --out");
  const sweep::Row row = row_to_run(spec, number);
  sil::OutputDir output(folder);
  if (!output.good()) return could_not(output.error());
  if (!output.write("row.toml", sweep::RowScenarios(spec).toml(row))) return could_not(output.error());
  if (!command.quiet) {
    std::cout << fmt::format("row {} of {}: seed {}", number, spec.name, row.seed);
    for (std::size_t i = 0; i < row.values.size(); ++i)
      std::cout << ", " << spec.vary[i].key << " = " << sweep::toml_value(row.values[i]);
    std::cout << std::endl;
  }
  std::vector<std::string> arguments{program::beside_this_program("ballast"), "run",
                                     (output.path() / "row.toml").string(), "--out", folder};
  if (command.quiet) arguments.push_back("--quiet");
  return could_not(program::become_program(arguments));
}

int run(const SweepCommand& command) {
  if (!command.merge.empty()) {
    const bool others = !command.sweep.empty() || !command.shard.empty() || !command.row.empty() || command.resume ||
                        !command.errors.empty() || !command.find_limit.empty() || command.jobs > 0;
    if (others) return refuse("--merge: takes folders of shards only; allowed beside it: --out, --map, --quiet");
    return merge(command);
  }
  if (command.sweep.empty()) return refuse("sweep: a sweep file is missing; allowed: SWEEP.toml, or --merge DIR...");
  sweep::Shard shard;
  if (!command.shard.empty() && !parse_shard(command.shard, shard))
    return refuse("--shard " + command.shard + ": allowed: K/N, whole numbers, 1 <= K <= N");
  auto spec = command.errors.empty() ? load_sweep(command.sweep) : load_errors(command);
  if (!spec) return program::kExitUsage;
  if (!command.find_limit.empty()) {
    if (const auto why = sweep::limit_refusal(*spec, command.find_limit); !why.empty())
      return refuse("--find-limit " + command.find_limit + ": " + why);
    spec->find_limit = command.find_limit;
  }
  if (const auto why = map_refusal(command, *spec); !why.empty()) return refuse(why);
  if (!command.row.empty() && (command.resume || !command.shard.empty() || !command.map.empty()))
    return refuse(
        "--row: runs one row again; allowed beside it: --out, --errors, --runs, --seed, --find-limit, --quiet");
  return command.row.empty() ? run_sweep(command, *spec, shard) : run_row_again(command, *spec);
}

}  // namespace

std::function<int()> add_sweep_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("sweep", "Runs a scenario many times with varied values, on all cores");
  auto options = std::make_shared<SweepCommand>();
  command->add_option("sweep", options->sweep, "the sweep, a TOML file; with --errors a scenario");
  command->add_option("--out", options->out, "folder for the results; default runs/NAME")->check(program::not_empty());
  command->add_option("--jobs", options->jobs, "runs at a time; default: one per core")
      ->check(program::whole_number(1, sweep::kMostJobs));
  command->add_option("--shard", options->shard, "K/N: only the K-th of N parts of the runs, for several machines")
      ->check(program::not_empty());
  command->add_flag("--resume", options->resume, "continue in a folder with finished blocks of this sweep");
  command->add_option("--merge", options->merge, "join the folders of all shards")->expected(1, -1);
  command->add_option("--row", options->row, "run one row again, as a full ballast run")->check(program::not_empty());
  command
      ->add_option("--find-limit", options->find_limit,
                   "search, in every row, the value of this key at which the run ceases to hold; its uniform or "
                   "log_uniform range is bisected")
      ->check(program::not_empty());
  command
      ->add_option("--map", options->map,
                   "X,Y: draw the share of the runs that hold over two varied keys, as map.png in the folder")
      ->check(program::not_empty());
  auto* errors = command
                     ->add_option("--errors", options->errors,
                                  "vary a scenario, given in place of a sweep file, by normal errors with these "
                                  "standard deviations: " +
                                      sweep::errors_allowed())
                     ->check(program::not_empty());
  command->add_option("--runs", options->runs, "runs of --errors")
      ->check(program::whole_number(1, std::numeric_limits<int>::max()))
      ->capture_default_str()
      ->needs(errors);
  command->add_option("--seed", options->seed, "seed of --errors")
      ->check(program::whole_number(0, std::numeric_limits<int>::max()))
      ->capture_default_str()
      ->needs(errors);
  command->add_flag("--quiet", options->quiet, "no progress; with --row, nothing but errors");
  return [options] { return run(*options); };
}

}  // namespace ballast
