// Random numbers that are the same on every platform, unlike std's distributions.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace ballast::sim {

// SplitMix64 (Steele, Lea and Flood 2014). Any state serves as a seed.
inline std::uint64_t random_bits(std::uint64_t& state) {
  state += 0x9E3779B97F4A7C15u;
  std::uint64_t z = state;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return z ^ (z >> 31);
}

// 0 <= .. < 1.
inline double uniform(std::uint64_t& state) { return static_cast<double>(random_bits(state) >> 11) * 0x1p-53; }

// Standard normal, by Box and Muller.
inline double normal(std::uint64_t& state) {
  const double radius = std::sqrt(-2 * std::log(1 - uniform(state)));
  return radius * std::cos(2 * std::numbers::pi * uniform(state));
}

}  // namespace ballast::sim
