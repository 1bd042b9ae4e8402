// Plans of random desk-like robots from rest to rest, over 2 to 4 radii along the direction in which they drive: random
// tasks of the planner (tools/plan/random_task.h).
#pragma once

#include <optional>
#include <string>

namespace ballast::tracking_test {

// The plan of robot `robot` as a scenario file. The same on every platform but for the last bits of sines. None, and
// `why` in words: this robot's task could not be made or planned, or is shorter.
[[nodiscard]] std::optional<std::string> random_plan(int robot, std::string& why);

}  // namespace ballast::tracking_test
