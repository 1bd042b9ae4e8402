// Scripts by which shells complete command lines of the program.
#pragma once

#include <string>
#include <vector>

#include "tools/ballast/command_table.h"

namespace ballast {

// `scenarios`: the names of those that ship.
std::string bash_completion(const CommandTable& table, const std::vector<std::string>& scenarios);
std::string zsh_completion(const CommandTable& table, const std::vector<std::string>& scenarios);
std::string fish_completion(const CommandTable& table, const std::vector<std::string>& scenarios);

}  // namespace ballast
