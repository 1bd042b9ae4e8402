// ballast report, ballast compare: pages of finished runs. ballast-report and ballast-compare beside this program make
// them.
#include <memory>
#include <string>
#include <vector>

#include "tools/ballast/commands.h"
#include "tools/program/program.h"
#include "tools/program/subprocess.h"

namespace ballast {

namespace {

// Replaces this process with that program. Returns only if it cannot be started.
int become(const std::string& name, const std::vector<std::string>& arguments) {
  std::vector<std::string> argv{program::beside_this_program(name).string()};
  argv.insert(argv.end(), arguments.begin(), arguments.end());
  return could_not(program::become_program(argv));
}

void add_out_option(CLI::App& command, std::string& out, const std::string& fallback) {
  command.add_option("--out", out, "the page's file; default " + fallback)->check(program::not_empty());
}

// "--" separates the files, one of which may be named like an option.
std::vector<std::string> command_line(const std::string& out, const std::vector<std::string>& files) {
  std::vector<std::string> arguments;
  if (!out.empty()) arguments.push_back("--out=" + out);
  arguments.emplace_back("--");
  arguments.insert(arguments.end(), files.begin(), files.end());
  return arguments;
}

}  // namespace

std::function<int()> add_report_command(CLI::App& app, CLI::App*& command) {
  struct Options {
    std::string log, out;
  };
  command = app.add_subcommand("report", "Makes one HTML page of a finished run: summary, plots and 3-d replay");
  auto options = std::make_shared<Options>();
  command->add_option("LOG", options->log, "run.lcmlog, or the folder of the run")
      ->required()
      ->check(program::not_empty());
  add_out_option(*command, options->out, "report.html beside the log");
  return [options] { return become("ballast-report", command_line(options->out, {options->log})); };
}

std::function<int()> add_compare_command(CLI::App& app, CLI::App*& command) {
  struct Options {
    std::string run_a, run_b, out;
  };
  command = app.add_subcommand("compare", "Lists how two runs differ, and makes an HTML page of both");
  auto options = std::make_shared<Options>();
  command->add_option("RUN_A", options->run_a, "folder of a run, or its log")->required()->check(program::not_empty());
  command->add_option("RUN_B", options->run_b, "folder of another run, or its log")
      ->required()
      ->check(program::not_empty());
  add_out_option(*command, options->out, "compare.html beside the log of RUN_B");
  return [options] { return become("ballast-compare", command_line(options->out, {options->run_a, options->run_b})); };
}

}  // namespace ballast
