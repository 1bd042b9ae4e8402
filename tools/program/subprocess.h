// Other programs, run to their end or in this one's place.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace ballast::program {

// The file an executable of this name is started from, looked for in PATH; empty if there is none.
std::filesystem::path find_program(const std::string& name);

// The file of this name beside this executable, there or not.
std::filesystem::path beside_this_program(const std::string& name);

struct ProgramOutcome {
  int exit_status = -1;  // -1: it could not be started, or a signal ended it
  std::string output;    // stdout and stderr
};

// Waits for its end. `argv[0]` is found in PATH unless it has a slash.
ProgramOutcome run_program(const std::vector<std::string>& argv);

// This process becomes that program. Returns only if it cannot, with the reason.
std::string become_program(const std::vector<std::string>& argv);

}  // namespace ballast::program
