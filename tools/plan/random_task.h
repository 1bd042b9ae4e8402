// Random tasks that can be done: robots of several kinds, and goals that a random admissible motion has reached. For
// measuring how many the planner finds.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace ballast::plan {

inline constexpr int kRandomRobots = 50;

// Task number `number` as a scenario file, of robot number % kRandomRobots, prescribed or with its motors' limits.
// Every second block of 50 has obstacles, via places or a path to follow, every fourth task also the places of the
// masses at the end; the motion that made the task keeps them all. The same on every platform but for the last bits of
// sines. None: no random motion of this robot is admissible, or the robot is no scenario; `why` says which.
[[nodiscard]] std::optional<std::string> random_task(std::uint64_t seed, int number, std::string& why);

// False in every fourth block of 50, from block 2 on: robots that can rest go from rest to rest, over a distance that
// friction allows with ease. No motion has shown that it can be done.
[[nodiscard]] bool is_surely_possible(int number);

// A floor that slopes and resists.
struct RandomFloor {
  double slope_rad = 0, rolling_resistance = 0;
};

// Task number `number` of desk-like robots, each of its own, on such a floor, with a random direction downhill: by
// turns to a place and to rest, with prescribed masses and with their motors' limits. The ball starts at rest. A random
// motion has shown that each can be done; one to rest has been bent at its end until the plant says that ball and
// masses rest in equilibrium.
[[nodiscard]] std::optional<std::string> random_floor_task(std::uint64_t seed, int number, const RandomFloor& floor,
                                                           std::string& why);

}  // namespace ballast::plan
