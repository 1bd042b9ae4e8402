// Random tasks that can be done: robots of several kinds, and goals that a random admissible motion has reached. For
// measuring how many the planner finds.
#pragma once

#include <cstdint>
#include <string>

namespace ballast::plan {

inline constexpr int kRandomRobots = 50;

// Task number `number` as a scenario file, of robot number % kRandomRobots. Every second task has obstacles or via
// places, which the motion that made it keeps. The same on every platform but for the last bits of sines.
[[nodiscard]] std::string random_task(std::uint64_t seed, int number);

}  // namespace ballast::plan
