// Cube root of a number >= 0, with the same bits on every processor. libm's bits differ between libraries.
#pragma once

#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <limits>
#include <type_traits>

namespace ballast::firmware {

// Error: at most 1 ulp. x < 0 and NaN give NaN; 0 and infinity are their own roots.
// A third of the bits, exponent and mantissa as one number, is the root to 3.2 % (W. Kahan). Each step of Halley's
// method leaves two thirds of the error's cube: 2e-5, 7e-15. The last step starts from a root cut to so few bits that
// its square is exact, and is added as a correction. The rounding of x / y^2, a third of which counts, and that of the
// sum remain, together 0.84 ulp. Small and large x are scaled by a cube, so that x / y^2 and the sums stay normal.
template <std::floating_point T>
[[nodiscard]] T cube_root(T x) {
  static_assert(std::is_same_v<T, double> || std::is_same_v<T, float>);
  constexpr bool kWide = std::is_same_v<T, double>;
  using Bits = std::conditional_t<kWide, std::uint64_t, std::uint32_t>;
  constexpr auto kThird = static_cast<Bits>(kWide ? 0x2a9f789300000000u : 0x2a5119f2u);
  constexpr int kDigits = std::numeric_limits<T>::digits;
  constexpr Bits kKept = ~((Bits{1} << (kDigits + 1) / 2) - 1);  // a square of no more than kDigits bits
  constexpr T kCube = T(1 << 30) * (1 << 24), kRoot = 1 << 18, kSmall = std::numeric_limits<T>::min() * kCube;

  if (!(x > 0) || std::isinf(x)) return x >= 0 ? x : std::numeric_limits<T>::quiet_NaN();
  T scale = 1;
  if (x < kSmall) {
    x *= kCube;
    scale = 1 / kRoot;
  } else if (x > 1 / kSmall) {
    x /= kCube;
    scale = kRoot;
  }
  T y = std::bit_cast<T>(static_cast<Bits>(std::bit_cast<Bits>(x) / 3 + kThird));
  for (int i = 0; i < 2; ++i) {
    const T cube = y * y * y;
    y *= (cube + 2 * x) / (2 * cube + x);
  }
  y = std::bit_cast<T>(std::bit_cast<Bits>(y) & kKept);
  const T from = x / (y * y);
  return (y + y * ((from - y) / (2 * y + from))) * scale;
}

}  // namespace ballast::firmware
