// ballast operate go.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tools/program/program.h"

namespace ballast {

// Printed before it halts a ball by itself, behind the reason.
inline constexpr std::string_view kHaltsFirst = "halts it first";
// Printed with a course that ends at a rest, before the place that it is planned to. The remaining way is planned
// while the ball rolls there.
inline constexpr std::string_view kOnItsWay = "on its way to";
// Printed instead of a course, where none is needed.
inline constexpr std::string_view kRestsThere = "rests there already";

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
