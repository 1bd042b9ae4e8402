// Manual pages of the program and its commands, for man.
#pragma once

#include <string>

#include "tools/ballast/command_table.h"

namespace ballast {

// The page of the program, in roff. `version`: "1.0.0".
std::string program_manual(const CommandTable& table, const std::string& version);

// The page PROGRAM-COMMAND of one of its commands.
std::string command_manual(const CommandTable& table, const CommandRow& command, const std::string& version);

}  // namespace ballast
