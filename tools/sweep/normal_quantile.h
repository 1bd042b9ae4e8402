// The quantile function of the normal distribution.
#pragma once

namespace ballast::sweep {

// The z with P(Z < z) = p for a standard normal Z and 0 < p < 1; relative error about 1e-16. Source: Wichura,
// "Algorithm AS 241", Applied Statistics 37 (1988), routine PPND16.
[[nodiscard]] double normal_quantile(double p);

}  // namespace ballast::sweep
