// ballast: the program that users run.
#include "tools/ballast/command_line.h"
#include "tools/ballast/commands.h"
#include "tools/ballast/tune_command.h"

int main(int argc, char** argv) {
  using namespace ballast;
  constexpr AddCommand kCommands[] = {
      add_run_command,        add_integrate_command, add_check_command,    add_faults_command, add_friction_command,
      add_move_command,       add_operate_command,   add_spy_command,      add_live_command,   add_watch_command,
      add_doctor_command,     add_soak_command,      add_replay_command,   add_report_command, add_compare_command,
      add_export_command,     add_plan_command,      add_new_command,      add_tune_command,   add_sweep_command,
      add_completion_command, add_manual_command,    add_identify_command,
  };
  return run_command_line(argc, argv, kCommands);
}
