#include "firmware/motion/cube_root.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

template <class T>
class CubeRoot : public ::testing::Test {};
using Scalars = ::testing::Types<double, float>;
TYPED_TEST_SUITE(CubeRoot, Scalars);

TYPED_TEST(CubeRoot, IsWithinAnUlpFromDenormalsToTheGreatest) {
  using T = TypeParam;
  using Limits = std::numeric_limits<T>;
  static_assert(std::numeric_limits<long double>::digits >= 64, "the reference needs more digits");
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(20240718));
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<T> mantissa(1, 2);
  for (int exponent = Limits::min_exponent - Limits::digits; exponent < Limits::max_exponent; ++exponent) {
    for (int k = 0; k < 300; ++k) {
      const T x = std::ldexp(mantissa(random), exponent);
      if (!(x > 0) || std::isinf(x)) continue;
      const long double root = std::cbrt(static_cast<long double>(x));
      const long double ulp = std::ldexp(1.0L, std::ilogb(root) + 1 - Limits::digits);
      ASSERT_LT(std::fabs(cube_root(x) - root), ulp) << x << ", seed " << seed;
    }
  }
}

TYPED_TEST(CubeRoot, OfCubesIsExact) {
  using T = TypeParam;
  for (int k = 0; k <= 200; ++k) EXPECT_EQ(cube_root(static_cast<T>(k * k * k)), static_cast<T>(k));
}

TYPED_TEST(CubeRoot, OfWhatHasNone) {
  using T = TypeParam;
  using Limits = std::numeric_limits<T>;
  EXPECT_EQ(cube_root(Limits::infinity()), Limits::infinity());
  EXPECT_TRUE(std::isnan(cube_root(T(-1))));
  EXPECT_TRUE(std::isnan(cube_root(Limits::quiet_NaN())));
}

}  // namespace
}  // namespace ballast::firmware
