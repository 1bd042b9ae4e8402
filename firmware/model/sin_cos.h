// Sine and cosine of one angle, with the same bits on every processor. libm's bits differ between libraries, and
// between processors of one library. This file uses only IEEE's +, -, * and fmod, which is exact.
//
// Error: at most 1 ulp for |x| <= kSinCosRange. Beyond it the result is within 1 ulp of that of a number at most half
// an ulp of x away from x; an x that was rounded is not known better. NaN and infinity give NaN. sin is odd and cos
// even to the bit; sin(-0) = -0.
//
// Proof of 1 ulp: n = x 2/pi is rounded, and r = x - n pi/2 is computed with pi/2 = parts + rest. The parts have few
// bits, so n times a part is exact. A difference that cancels is exact too, and the error of one that does not is kept.
// The rounding of n times the rest, n 2^-129 (double) or n 2^-67 (float), is lost: 0.002 ulp of the least r of any x in
// the range. From there on r is a sum hi + lo. The polynomials err by 0.06 ulp and the last sum rounds by half an ulp.
// The smaller of its terms, at most 0.3 of the result, rounds too. tests/firmware/sin_cos_test.cpp finds 0.79 ulp in
// all.
//
// Source: the reduction in parts is Cody and Waite's, the order of summation that of the Sun Microsystems fdlibm
// kernels. The polynomials are our own Remez fits of the relative errors of sin and cos; coefficients are rounded one
// after the other, and the remaining ones fitted again.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>

namespace ballast::firmware {

template <class T>
struct SinCos {
  T sin;
  T cos;
};

namespace detail {

template <class T>
struct SinCosConstants;

template <>
struct SinCosConstants<double> {
  using Bits = std::uint64_t;
  static constexpr double kShift = 0x1.8p52;       // adding it rounds to a whole number, in the low bits
  static constexpr double kMostQuadrants = 65536;  // n needs 16 bits, which leaves a part 37
  static constexpr double kTwoPi = 0x1.921fb54442d18p2;
  static constexpr double kTwoOverPi = 0x1.45f306dc9c883p-1;
  static constexpr std::array<double, 2> kHalfPi{0x1.921fb5444p0, 0x1.68c234c4cp-39};
  static constexpr double kHalfPiRest = 0x1.98a2e03707345p-77;
  // (sin(r) - r) / r^3 and (cos(r) - 1 + r^2/2) / r^4 in powers of r^2: relative errors of sin and cos 2^-57.9, 2^-63.9
  static constexpr std::array<double, 6> kSin{-0x1.5555555555548p-3, 0x1.111111110f73p-7,    -0x1.a01a019be9217p-13,
                                              0x1.71de35552b52cp-19, -0x1.ae5e4b83e46f4p-26, 0x1.5d8b559495e1ep-33};
  static constexpr std::array<double, 6> kCos{0x1.555555555554bp-5,   -0x1.6c16c16c15013p-10, 0x1.a01a019c8ed07p-16,
                                              -0x1.27e4f7f1410dap-22, 0x1.1ee9db8e2ed98p-29,  -0x1.8fa65e910319ep-37};
};

template <>
struct SinCosConstants<float> {
  using Bits = std::uint32_t;
  static constexpr float kShift = 0x1.8p23f;
  static constexpr float kMostQuadrants = 1024;  // 10 bits, which leaves a part 14
  static constexpr float kTwoPi = 0x1.921fb6p2f;
  static constexpr float kTwoOverPi = 0x1.45f306p-1f;
  static constexpr std::array<float, 3> kHalfPi{0x1.9218p0f, 0x1.ed5p-14f, 0x1.10bp-30f};
  static constexpr float kHalfPiRest = 0x1.184698p-44f;
  // 2^-27.9 and 2^-33.0
  static constexpr std::array<float, 3> kSin{-0x1.555546p-3f, 0x1.110778p-7f, -0x1.9953fep-13f};
  static constexpr std::array<float, 3> kCos{0x1.55554ap-5f, -0x1.6c0c28p-10f, 0x1.99e80cp-16f};
};

// c_first + c_first+1 z + ...
template <std::size_t first, class T, std::size_t size>
[[gnu::always_inline]] constexpr T polynomial(const std::array<T, size>& c, T z) {
  T sum = c[size - 1];
  for (std::size_t k = size - 1; k-- > first;) sum = c[k] + z * sum;
  return sum;
}

// Brings x into the range. fmod is exact, and 2 pi is rounded by less than half an ulp.
template <class T>
[[gnu::noinline, gnu::cold]] T turns_removed(T x) {
  return std::fmod(x, SinCosConstants<T>::kTwoPi);
}

}  // namespace detail

// 102,943 for double: 16,384 turns. 1,608 for float: 256 turns.
template <std::floating_point T>
inline constexpr T kSinCosRange = detail::SinCosConstants<T>::kMostQuadrants* T(1.5707963267948966);

template <std::floating_point T>
[[gnu::always_inline]] inline SinCos<T> sin_cos(T x) {
  using K = detail::SinCosConstants<T>;
  using Bits = typename K::Bits;
  if (!(std::fabs(x) <= kSinCosRange<T>)) [[unlikely]]
    x = detail::turns_removed(x);

  const T shifted = x * K::kTwoOverPi + K::kShift;
  const T n = shifted - K::kShift;
  T r = x - n * K::kHalfPi[0], lost = 0;
  for (std::size_t k = 1; k < K::kHalfPi.size(); ++k) {
    const T part = n * K::kHalfPi[k], next = r - part;
    const T error = part - (r - next);  // exact, and 0 where r < part
    lost = k == 1 ? error : lost + error;
    r = next;
  }
  lost += n * K::kHalfPiRest;
  const T hi = r - lost, lo = (r - hi) - lost;

  const T z = hi * hi, cube = z * hi, half = z / 2;
  const T s = hi - ((z * (lo / 2 - cube * detail::polynomial<1>(K::kSin, z)) - lo) - cube * K::kSin[0]);
  const T near_one = 1 - half;
  const T c = near_one + (((1 - near_one) - half) + (z * (z * detail::polynomial<0>(K::kCos, z)) - hi * lo));

  // Odd quadrants exchange the two; sin changes its sign in quadrants 2 and 3, cos in 1 and 2. In integers: no branch.
  const auto quadrant = std::bit_cast<Bits>(shifted);
  const auto s_bits = std::bit_cast<Bits>(s), c_bits = std::bit_cast<Bits>(c);
  const Bits exchanged = (s_bits ^ c_bits) & (0 - (quadrant & 1));
  constexpr int kToSign = 8 * sizeof(T) - 2;  // from bit 1
  return {std::bit_cast<T>((s_bits ^ exchanged) ^ ((quadrant & 2) << kToSign)),
          std::bit_cast<T>((c_bits ^ exchanged) ^ (((quadrant + 1) & 2) << kToSign))};
}

// Any other scalar with sin and cos: complex, for derivatives by complex step.
template <class T>
requires(!std::floating_point<T>) SinCos<T> sin_cos(const T& x) {
  using std::cos;
  using std::sin;
  return {sin(x), cos(x)};
}

}  // namespace ballast::firmware
