// The commands of `ballast`. Each function adds a command to the command line and returns the function that runs it,
// which returns the exit status.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

namespace ballast {

// Prints "ballast: TEXT" to stderr. refuse() returns the exit status of a bad command line or scenario, could_not()
// that of trouble with files, buses and peers.
int refuse(const std::string& text);
int could_not(const std::string& text);

std::function<int()> add_run_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_integrate_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_check_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_new_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_plan_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_move_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_operate_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_identify_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_faults_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_friction_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_spy_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_soak_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_sweep_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_replay_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_report_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_compare_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_live_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_watch_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_doctor_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_export_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_completion_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_manual_command(CLI::App& app, CLI::App*& command);

}  // namespace ballast
