// ballast manual: the manual pages of this program and its commands.
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <string>

#include "tools/ballast/command_table.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/manual_page.h"
#include "tools/program/places.h"
#include "tools/program/program.h"

namespace ballast {
namespace {

// Writes PROGRAM.1 and PROGRAM-COMMAND.1 of every command. Returns the exit status.
int write_pages(const CommandTable& table, const std::filesystem::path& folder) {
  const auto write = [&folder](const std::string& page, const std::string& text) {
    const std::filesystem::path file = folder / (page + ".1");
    std::ofstream stream(file);
    if (stream << text << std::flush) return program::kExitCompleted;
    return could_not(file.string() + ": cannot be written: " + std::strerror(errno));
  };
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return could_not(folder.string() + ": cannot be made: " + error.message());
  int status = write(table.program, program_manual(table, program::version()));
  for (const CommandRow& command : table.commands) {
    if (status != program::kExitCompleted) break;
    status = write(table.program + "-" + command.name, command_manual(table, command, program::version()));
  }
  return status;
}

}  // namespace

std::function<int()> add_manual_command(CLI::App& app, CLI::App*& command) {
  struct Options {
    std::string command, out;
  };
  command = app.add_subcommand("manual", "Prints the manual page of this program or of a command, for man");
  auto options = std::make_shared<Options>();
  command->add_option("COMMAND", options->command, "a command; default: the program itself");
  command->add_option("--out", options->out, "FOLDER: write the pages of all commands there instead")
      ->check(program::not_empty());
  return [&app, options] {
    const CommandTable table = command_table(app);
    if (!options->out.empty()) return write_pages(table, options->out);
    if (options->command.empty()) {
      std::cout << program_manual(table, program::version());
      return program::kExitCompleted;
    }
    const auto found = std::find_if(table.commands.begin(), table.commands.end(),
                                    [&](const CommandRow& row) { return row.name == options->command; });
    if (found == table.commands.end())
      return refuse(options->command + ": no such command; " + table.program + " --help lists them");
    std::cout << command_manual(table, *found, program::version());
    return program::kExitCompleted;
  };
}

}  // namespace ballast
