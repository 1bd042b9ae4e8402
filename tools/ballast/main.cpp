// ballast: the program people run.
#include <vector>

#include "tools/ballast/commands.h"
#include "tools/program/program.h"

int main(int argc, char** argv) {
  using namespace ballast;
  CLI::App app{"Controller firmware, plant simulation and envelope monitor for rolling-ball robots.", "ballast"};
  app.require_subcommand(1);
  struct Command {
    CLI::App* app = nullptr;
    std::function<int()> run;
  };
  std::vector<Command> commands(6);
  commands[0].run = add_run_command(app, commands[0].app);
  commands[1].run = add_integrate_command(app, commands[1].app);
  commands[2].run = add_check_command(app, commands[2].app);
  commands[3].run = add_move_command(app, commands[3].app);
  commands[4].run = add_report_command(app, commands[4].app);
  commands[5].run = add_compare_command(app, commands[5].app);
  if (const auto exit_status = program::parse(app, argc, argv)) return *exit_status;
  for (const Command& command : commands) {
    if (command.app->parsed()) return command.run();
  }
  return program::kExitUsage;
}
