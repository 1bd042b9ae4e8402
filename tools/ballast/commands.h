// The commands of `ballast`: each adds itself to the command line and, once chosen, runs and gives the exit status.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace ballast {

std::function<int()> add_run_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_integrate_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_check_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_move_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_operate_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_faults_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_friction_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_spy_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_soak_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_replay_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_report_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_compare_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_watch_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_doctor_command(CLI::App& app, CLI::App*& command);
std::function<int()> add_export_command(CLI::App& app, CLI::App*& command);

}  // namespace ballast
