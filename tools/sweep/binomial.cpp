#include "tools/sweep/binomial.h"

#include <algorithm>
#include <cmath>

namespace ballast::sweep {
namespace {

constexpr double kZ = 1.959963984540054;  // normal quantile of 0.975

std::uint64_t rank_at(double place, std::uint64_t count) {
  return static_cast<std::uint64_t>(std::clamp(place, 0.0, static_cast<double>(count - 1)));
}

}  // namespace

Interval wilson_interval(std::uint64_t hits, std::uint64_t count) {
  const double n = static_cast<double>(count), p = static_cast<double>(hits) / n, z2 = kZ * kZ;
  const double middle = (p + z2 / (2 * n)) / (1 + z2 / n);
  const double half = kZ / (1 + z2 / n) * std::sqrt(p * (1 - p) / n + z2 / (4 * n * n));
  // At 0 and 1 the interval ends there, up to rounding.
  return {hits == 0 ? 0 : std::max(0.0, middle - half), hits == count ? 1 : std::min(1.0, middle + half)};
}

QuantileRanks quantile_ranks(double share, std::uint64_t count) {
  const double n = static_cast<double>(count), half = kZ * std::sqrt(n * share * (1 - share));
  return {rank_at(std::ceil(share * n) - 1, count), rank_at(std::floor(share * n - half) - 1, count),
          rank_at(std::ceil(share * n + half) - 1, count)};
}

}  // namespace ballast::sweep
