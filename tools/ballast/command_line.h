// The command line of a program that is made of commands: `ballast` has all of them, `ballast-run` only `run`.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <span>

namespace ballast {

// Adds a command to the command line and returns what runs it: run() gives the exit status.
using AddCommand = std::function<int()> (*)(CLI::App& app, CLI::App*& command);

// Runs the command that the arguments name; returns the exit status of the program.
int run_command_line(int argc, char** argv, std::span<const AddCommand> commands);

}  // namespace ballast
