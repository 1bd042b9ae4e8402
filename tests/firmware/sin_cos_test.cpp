#include "firmware/model/sin_cos.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <random>

#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

// The reference: libm's functions in a wider type, good to 1 ulp of that.
using Long = long double;
static_assert(std::numeric_limits<Long>::digits >= 64,
              "eleven bits more than double: 1/2000 of the ulps measured here");

const auto seed = static_cast<unsigned>(ballast::test::random_seed(20240718));

template <class T>
Long ulps(T got, Long wanted) {
  return std::fabs(static_cast<Long>(got) - wanted) /
         std::ldexp(Long{1}, std::ilogb(wanted) + 1 - std::numeric_limits<T>::digits);
}

// The worst of what was looked at.
template <class T>
struct Worst {
  Long ulps_sin = 0, ulps_cos = 0;
  T at_sin = 0, at_cos = 0;

  void look(T x) {
    const SinCos<T> got = sin_cos(x);
    const Long s = ulps(got.sin, std::sin(static_cast<Long>(x))), c = ulps(got.cos, std::cos(static_cast<Long>(x)));
    if (!(s <= ulps_sin)) ulps_sin = s, at_sin = x;
    if (!(c <= ulps_cos)) ulps_cos = c, at_cos = x;
  }
};

template <class T>
class SinCosOf : public ::testing::Test {};
using Scalars = ::testing::Types<double, float>;
TYPED_TEST_SUITE(SinCosOf, Scalars);

TYPED_TEST(SinCosOf, RandomAnglesAreWithinAnUlp) {
  using T = TypeParam;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<T> unit(-1, 1), binary(-60, 0);
  Worst<T> worst;
  for (int k = 0; k < 200'000; ++k) {
    worst.look(unit(random) * T(0.79));                                      // no reduction
    worst.look(unit(random) * 7);                                            // a turn
    worst.look(unit(random) * kSinCosRange<T>);                              // anywhere
    worst.look(unit(random) * kSinCosRange<T> * std::exp2(binary(random)));  // of any size
  }
  EXPECT_LT(worst.ulps_sin, 1) << "at " << worst.at_sin << ", seed " << seed;
  EXPECT_LT(worst.ulps_cos, 1) << "at " << worst.at_cos << ", seed " << seed;
  EXPECT_GT(worst.ulps_sin, 0.5) << "no arithmetic rounds this well: the reference is not one";
}

// Where the reduction has to be good, since sin or cos is small, and where the quadrant changes: every multiple of pi/4
// in the range, its neighbours, and some further off.
TYPED_TEST(SinCosOf, AnglesNearMultiplesOfAnEighthTurnAreWithinAnUlp) {
  using T = TypeParam;
  Worst<T> worst;
  const int most = static_cast<int>(2 * detail::SinCosConstants<T>::kMostQuadrants);
  for (int n = 1; n <= most; ++n) {
    const auto near = static_cast<T>(n * (std::numbers::pi_v<Long> / 4));
    for (const T x :
         {near, std::nextafter(near, T(0)), std::nextafter(near, 2 * near), near * (1 - T(1e-4) / static_cast<T>(n))}) {
      if (x <= kSinCosRange<T>) worst.look(x);
    }
  }
  EXPECT_LT(worst.ulps_sin, 1) << "at " << worst.at_sin;
  EXPECT_LT(worst.ulps_cos, 1) << "at " << worst.at_cos;
}

TYPED_TEST(SinCosOf, SinIsOddAndCosEvenToTheBit) {
  using T = TypeParam;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<T> unit(0, 1), binary(-40, 8);
  for (int k = 0; k < 200'000; ++k) {
    const T x = unit(random) * kSinCosRange<T> * std::exp2(binary(random));  // beyond the range too
    const SinCos<T> plus = sin_cos(x), minus = sin_cos(-x);
    ASSERT_EQ(plus.sin, -minus.sin) << x << ", seed " << seed;
    ASSERT_EQ(plus.cos, minus.cos) << x << ", seed " << seed;
  }
  EXPECT_FALSE(std::signbit(sin_cos(T(0)).sin));
  EXPECT_TRUE(std::signbit(sin_cos(T(-0.)).sin));
  EXPECT_EQ(sin_cos(T(0)).cos, 1);
}

TYPED_TEST(SinCosOf, SquaresAddUpToOne) {
  using T = TypeParam;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<T> unit(-1, 1), binary(-20, std::numeric_limits<T>::max_exponent - 18);
  for (int k = 0; k < 200'000; ++k) {
    const T x = unit(random) * kSinCosRange<T> * std::exp2(binary(random));
    const SinCos<T> a = sin_cos(x);
    const Long sum = static_cast<Long>(a.sin) * a.sin + static_cast<Long>(a.cos) * a.cos;
    // 1 ulp of numbers below 1 is epsilon/2: 2 (|sin| + |cos|) epsilon/2 <= sqrt(2) epsilon.
    ASSERT_LT(std::fabs(sum - 1), 1.42 * std::numeric_limits<T>::epsilon()) << x << ", seed " << seed;
  }
}

TYPED_TEST(SinCosOf, TinyAnglesAreTheirSines) {
  using T = TypeParam;
  for (T x = std::numeric_limits<T>::epsilon() / 4; x > 0; x /= 2) {  // down to the last denormal
    ASSERT_EQ(sin_cos(x).sin, x);
    ASSERT_EQ(sin_cos(x).cos, 1);
  }
}

// Beyond the range: of a number within half an ulp of x, so off by no more than that, and 1 ulp.
TYPED_TEST(SinCosOf, LargeAnglesAreRightToTheirOwnRounding) {
  using T = TypeParam;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<T> binary(0, std::numeric_limits<T>::digits);
  for (int k = 0; k < 100'000; ++k) {
    const T x = kSinCosRange<T> * std::exp2(binary(random));
    const SinCos<T> a = sin_cos(x);
    const Long half_ulp = std::ldexp(Long{1}, std::ilogb(x) - std::numeric_limits<T>::digits);
    const Long allowed = half_ulp + std::numeric_limits<T>::epsilon();
    ASSERT_LE(std::fabs(static_cast<Long>(a.sin) - std::sin(static_cast<Long>(x))), allowed) << x << ", seed " << seed;
    ASSERT_LE(std::fabs(static_cast<Long>(a.cos) - std::cos(static_cast<Long>(x))), allowed) << x << ", seed " << seed;
  }
}

TYPED_TEST(SinCosOf, WhatIsNoAngleGivesNaN) {
  using T = TypeParam;
  using Limits = std::numeric_limits<T>;
  for (const T x : {Limits::quiet_NaN(), -Limits::quiet_NaN(), Limits::infinity(), -Limits::infinity()}) {
    EXPECT_TRUE(std::isnan(sin_cos(x).sin));
    EXPECT_TRUE(std::isnan(sin_cos(x).cos));
  }
  EXPECT_LE(std::fabs(sin_cos(Limits::max()).sin), 1);
}

TEST(SinCos, ComplexStep) {
  const SinCos<std::complex<double>> a = sin_cos(std::complex<double>(0.7, 1e-100));
  EXPECT_NEAR(a.sin.imag() / 1e-100, std::cos(0.7), 1e-15);  // a few roundings
  EXPECT_NEAR(a.cos.imag() / 1e-100, -std::sin(0.7), 1e-15);
}

}  // namespace
}  // namespace ballast::firmware
