// The command `tune`, in a header of its own: that of all commands is read by each of them.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace ballast {

// As the functions of commands.h.
std::function<int()> add_tune_command(CLI::App& app, CLI::App*& command);

}  // namespace ballast
