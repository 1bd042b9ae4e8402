// ballast operate go.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/program/program.h"

namespace ballast {

struct GoCommand {
  std::string to;                // "X,Y" in m, of the geometric centre
  std::vector<std::string> via;  // on the way, in order
  std::optional<double> duration_s;
  std::string objective = "friction";
  double time_limit_s = 20;  // wall clock, for planning
  bool wait = false;         // until the ball is there
  program::BusOptions bus;
};

void add_go_options(CLI::App& command, GoCommand& options);

// Returns the exit status.
int go_on_bus(const GoCommand& command);

}  // namespace ballast
