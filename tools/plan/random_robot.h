// Random robots, as the first part of a scenario file: for random tasks.
#pragma once

#include <cstdint>
#include <random>
#include <string>

namespace ballast::plan {

// Numbers that are the same on every platform.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  int pick(int count) { return static_cast<int>(between(0, count - 1e-9)); }
  bool coin() { return (engine_() >> 40 & 1) != 0; }

 private:
  std::mt19937_64 engine_;
};

// Gravity, [ball], [[mass]] and [surface] of robot `robot`: 1 to 4 masses on rings, lines or splines in balls of
// different scale. Robots with an odd number / 5 are made for their motors (see has_motors()).
[[nodiscard]] std::string random_robot(std::uint64_t seed, int robot);

// The robot's motors are to drive the masses; otherwise the masses are prescribed.
[[nodiscard]] bool has_motors(int robot);

}  // namespace ballast::plan
