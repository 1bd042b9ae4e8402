// Random numbers that are the same on every machine, unlike the distributions of <random>. Draw one number per
// expression, since the compiler chooses the order in which the parts of an expression are computed.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <numbers>
#include <random>

namespace ballast::soak {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    constexpr double kUnit = 0x1p-53;
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * kUnit);
  }
  // The logarithm is uniformly distributed.
  double log_uniform(double low, double high) { return std::exp(uniform(std::log(low), std::log(high))); }
  int integer(int low, int high) {  // both included; high - low is far below 2^32, so that no number is favoured
    return low + static_cast<int>((engine_() >> 32) * static_cast<std::uint64_t>(high - low + 1) >> 32);
  }
  bool chance(double probability) { return uniform(0, 1) < probability; }
  template <class T>
  T one_of(std::initializer_list<T> values) {
    return values.begin()[integer(0, static_cast<int>(values.size()) - 1)];
  }
  Eigen::Vector3d direction() {
    const double z = uniform(-1, 1), angle = uniform(0, 2 * std::numbers::pi), xy = std::sqrt(1 - z * z);
    return {xy * std::cos(angle), xy * std::sin(angle), z};
  }
  Eigen::Vector3d vector(double shortest, double longest) {
    const double length = uniform(shortest, longest);
    return length * direction();
  }
  Eigen::Quaterniond attitude() {
    const double angle = uniform(0, std::numbers::pi);
    return Eigen::Quaterniond(Eigen::AngleAxisd(angle, direction()));
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace ballast::soak
