// ballast export: a log as CSV tables or as MCAP for Foxglove. ballast-export does the work in Python, which reads the
// layout of a message from its type, so that no list of fields is needed.
#include <memory>

#include "tools/ballast/commands.h"
#include "tools/program/program.h"
#include "tools/program/subprocess.h"

namespace ballast {

namespace {

struct ExportCommand {
  std::string log, csv, mcap;
};

int export_log(const ExportCommand& command) {
  if (command.csv.empty() && command.mcap.empty()) {
    return refuse("export: no output is given; allowed: --csv DIR, --mcap FILE, or both");
  }
  const auto exporter = program::beside_this_program("ballast-export");
  std::vector<std::string> argv{exporter.string()};
  if (!command.csv.empty()) argv.push_back("--csv=" + command.csv);
  if (!command.mcap.empty()) argv.push_back("--mcap=" + command.mcap);
  argv.insert(argv.end(), {"--", command.log});
  return could_not(program::become_program(argv));
}

}  // namespace

std::function<int()> add_export_command(CLI::App& app, CLI::App*& command) {
  command = app.add_subcommand("export", "Writes a log as CSV, one table per channel, or as MCAP for Foxglove");
  auto options = std::make_shared<ExportCommand>();
  command->add_option("LOG", options->log, "an LCM event log, or the folder of a run")
      ->required()
      ->check(program::not_empty());
  command->add_option("--csv", options->csv, "folder for CHANNEL.csv")->check(program::not_empty());
  command->add_option("--mcap", options->mcap, "file for Foxglove")->check(program::not_empty());
  return [options] { return export_log(*options); };
}

}  // namespace ballast
