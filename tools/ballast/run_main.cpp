// ballast-run: `ballast` with the one command that tools/run needs, so that a first result waits for no other.
#include "tools/ballast/command_line.h"
#include "tools/ballast/commands.h"

int main(int argc, char** argv) {
  constexpr ballast::AddCommand kCommands[] = {ballast::add_run_command};
  return ballast::run_command_line(argc, argv, kCommands);
}
