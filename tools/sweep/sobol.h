// Sobol's sequence with the direction numbers of Joe and Kuo. Every point is computed by itself, from its index.
// Source: S. Joe, F. Y. Kuo, "Constructing Sobol sequences with better two-dimensional projections", SIAM Journal on
// Scientific Computing 30 (2008), pages 2635 to 2654. The order of the points is the Gray code's, as in their program.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace ballast::sweep {

inline constexpr std::size_t kSobolDimensions = 64;

// 64 bits of the point's coordinate, as a fraction of 2^64. dimension < kSobolDimensions, index < 2^53.
[[nodiscard]] std::uint64_t sobol_bits(std::size_t dimension, std::uint64_t index);

}  // namespace ballast::sweep
