// ballast: the program that users run.
#include "tools/ballast/commands.h"
#include "tools/program/program.h"

int main(int argc, char** argv) {
  using namespace ballast;
  CLI::App app{"Controller firmware, plant simulation and envelope monitor for rolling-ball robots.", "ballast"};
  app.require_subcommand(1);
  struct Command {
    std::function<int()> (*add)(CLI::App&, CLI::App*&);
    CLI::App* app = nullptr;
    std::function<int()> run = {};
  };
  Command commands[] = {
      {add_run_command},  {add_integrate_command}, {add_check_command},  {add_faults_command},  {add_friction_command},
      {add_move_command}, {add_operate_command},   {add_spy_command},    {add_watch_command},   {add_doctor_command},
      {add_soak_command}, {add_replay_command},    {add_report_command}, {add_compare_command}, {add_export_command},
  };
  for (Command& command : commands) command.run = command.add(app, command.app);
  if (const auto exit_status = program::parse(app, argc, argv)) return *exit_status;
  for (const Command& command : commands) {
    if (command.app->parsed()) return program::after_output("ballast", command.run());
  }
  return program::kExitUsage;
}
