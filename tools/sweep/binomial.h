// Confidence intervals of shares and quantiles that are counted in a random sample.
#pragma once

#include <cstdint>
#include <optional>

namespace ballast::sweep {

struct Interval {
  double low = 0, high = 1;
};

// The 95 % interval of Wilson for the share behind `hits` of `count` > 0. Source: Brown, Cai, DasGupta, "Interval
// estimation for a binomial proportion", Statistical Science 16 (2001), section 3.1.1.
[[nodiscard]] Interval wilson_interval(std::uint64_t hits, std::uint64_t count);

// Ranks, from 0, in `count` > 0 sorted values.
struct QuantileRanks {
  std::uint64_t value;  // of the quantile itself, the nearest rank
  // The true quantile lies below the one value, and above the other, with a probability of 2.5 % at most each. nullopt:
  // there are too few values to say.
  std::optional<std::uint64_t> low, high;
};
// Order statistics: the number of values below the true quantile has a binomial distribution. That is summed, and
// beyond 10^5 values approximated by the normal one.
[[nodiscard]] QuantileRanks quantile_ranks(double share, std::uint64_t count);

}  // namespace ballast::sweep
