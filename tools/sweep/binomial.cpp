#include "tools/sweep/binomial.h"

#include <algorithm>
#include <cmath>

namespace ballast::sweep {
namespace {

constexpr double kZ = 1.959963984540054;  // normal quantile of 0.975

constexpr double kOutside = 0.025;  // on each side of an interval
constexpr std::uint64_t kMostSummed = 100'000;

// The orders from 1 in between which the quantile lies; 0 and more than `count`: there is no such value.
struct Orders {
  std::uint64_t low = 0, high = 0;
};

Orders summed_orders(double share, std::uint64_t count) {
  // `below`: probability that at most k values lie below the quantile.
  const double n = static_cast<double>(count), odds = std::log(share) - std::log1p(-share);
  double log_of_k = n * std::log1p(-share), below = 0;
  Orders orders{0, count + 1};
  for (std::uint64_t k = 0; k <= count; ++k) {
    below += std::exp(log_of_k);
    if (below <= kOutside) orders.low = k + 1;
    if (below >= 1 - kOutside) {
      orders.high = k + 1;
      break;
    }
    log_of_k += odds + std::log((n - static_cast<double>(k)) / static_cast<double>(k + 1));
  }
  return orders;
}

Orders orders_of(double share, std::uint64_t count) {
  if (count <= kMostSummed) return summed_orders(share, count);
  const double n = static_cast<double>(count), half = kZ * std::sqrt(n * share * (1 - share));
  return {static_cast<std::uint64_t>(std::max(0.0, std::floor(share * n - half))),
          static_cast<std::uint64_t>(std::ceil(share * n + half))};
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
  const double place =
      std::clamp(std::ceil(share * static_cast<double>(count)) - 1, 0.0, static_cast<double>(count - 1));
  const Orders orders = orders_of(share, count);
  QuantileRanks ranks{static_cast<std::uint64_t>(place), std::nullopt, std::nullopt};
  if (orders.low >= 1) ranks.low = orders.low - 1;
  if (orders.high <= count) ranks.high = orders.high - 1;
  return ranks;
}

}  // namespace ballast::sweep
