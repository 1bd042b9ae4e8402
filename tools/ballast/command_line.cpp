#include "tools/ballast/command_line.h"

#include <vector>

#include "tools/ballast/commands.h"
#include "tools/program/program.h"

namespace ballast {

int refuse(const std::string& text) {
  program::complain("ballast", text);
  return program::kExitUsage;
}

int could_not(const std::string& text) {
  program::complain("ballast", text);
  return program::kExitCouldNotRun;
}

int run_command_line(int argc, char** argv, std::span<const AddCommand> commands) {
  CLI::App app{"Controller firmware, plant simulation and envelope monitor for rolling-ball robots.", "ballast"};
  app.require_subcommand(1);
  struct Command {
    CLI::App* app = nullptr;
    std::function<int()> run;
  };
  std::vector<Command> added;
  for (const AddCommand add : commands) {
    Command command;
    command.run = add(app, command.app);
    added.push_back(std::move(command));
  }
  if (const auto exit_status = program::parse(app, argc, argv)) return *exit_status;
  for (const Command& command : added) {
    if (command.app->parsed()) return program::after_output("ballast", command.run());
  }
  return program::kExitUsage;
}

}  // namespace ballast
