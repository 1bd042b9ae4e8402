// Confidence intervals of shares and quantiles that are counted in a random sample.
#pragma once

#include <cstdint>

namespace ballast::sweep {

struct Interval {
  double low = 0, high = 1;
};

// The 95 % interval of Wilson for the share behind `hits` of `count` > 0. Source: Brown, Cai, DasGupta, "Interval
// estimation for a binomial proportion", Statistical Science 16 (2001), section 3.1.1.
[[nodiscard]] Interval wilson_interval(std::uint64_t hits, std::uint64_t count);

// Ranks, from 0, in `count` > 0 sorted values.
struct QuantileRanks {
  std::uint64_t value;      // of the quantile itself, the nearest rank
  std::uint64_t low, high;  // the true quantile lies between these values with a probability of about 95 %
};
// Order statistics, with the normal approximation of the binomial distribution.
[[nodiscard]] QuantileRanks quantile_ranks(double share, std::uint64_t count);

}  // namespace ballast::sweep
