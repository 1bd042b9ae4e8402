// Random numbers from counters, and the distributions made of them.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "tests/sweep/sweeps.h"
#include "tools/sweep/normal_quantile.h"
#include "tools/sweep/philox.h"
#include "tools/sweep/rows.h"

namespace ballast::sweep {
namespace {

// The known answers of the authors' library, Random123, file kat_vectors.
TEST(Philox, GivesTheKnownAnswers) {
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (PhiloxBlock{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr std::uint32_t kOnes = 0xffffffff;
  EXPECT_EQ(philox({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes}),
            (PhiloxBlock{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (PhiloxBlock{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(UnitInterval, ExcludesItsEnds) {
  EXPECT_GT(unit_interval(0), 0.0);
  EXPECT_LT(unit_interval(~std::uint64_t{0}), 1.0);
}

// erfc is exact to some ulp; near 0 and 1 its error is relative, hence the comparison of logarithms' worth.
TEST(NormalQuantile, InvertsTheDistribution) {
  for (const double p : {1e-300, 1e-20, 1e-9, 0.001, 0.0751, 0.3, 0.5, 0.7, 0.92, 0.9999}) {
    const double z = normal_quantile(p), back = std::erfc(-z / std::sqrt(2.0)) / 2;
    // An error of 1e-15 in z changes p by the factor 1 - z dz in the tail.
    EXPECT_NEAR(back / p, 1, 1e-14 * (1 + z * z)) << p;
  }
}

Spec one_variation(Distribution distribution, double a, double b) {
  Spec spec;
  spec.repeats = 20000;
  spec.seed = 5;
  spec.vary.push_back({"x", distribution, a, b, {}, 0});
  return spec;
}

struct Moments {
  double mean = 0, deviation = 0;
  double least = std::numeric_limits<double>::infinity(), greatest = -least;
};
template <class Transform>
Moments moments(const Spec& spec, const Transform& transform) {
  Moments m;
  double sum = 0, squares = 0;
  for (std::uint64_t i = 0; i < spec.rows(); ++i) {
    const double x = transform(make_row(spec, i).values[0].number);
    sum += x;
    squares += x * x;
    m.least = std::min(m.least, x);
    m.greatest = std::max(m.greatest, x);
  }
  const auto n = static_cast<double>(spec.rows());
  m.mean = sum / n;
  m.deviation = std::sqrt(squares / n - m.mean * m.mean);
  return m;
}

// Five standard errors of 20,000 draws: deviation / 141 for a mean, deviation / 200 for a deviation.
TEST(Rows, HaveTheDistributionsAskedFor) {
  const auto same = [](double x) { return x; };
  const Moments normal = moments(one_variation(Distribution::kNormal, 3, 0.5), same);
  EXPECT_NEAR(normal.mean, 3, 5 * 0.5 / 141);
  EXPECT_NEAR(normal.deviation, 0.5, 5 * 0.5 / 200);
  const Moments uniform = moments(one_variation(Distribution::kUniform, -1, 3), same);
  EXPECT_NEAR(uniform.mean, 1, 5 * 4 / std::sqrt(12.0) / 141);
  EXPECT_GE(uniform.least, -1);
  EXPECT_LE(uniform.greatest, 3);
  const Moments logs =
      moments(one_variation(Distribution::kLogUniform, 0.01, 100), [](double x) { return std::log10(x); });
  EXPECT_NEAR(logs.mean, 0, 5 * 4 / std::sqrt(12.0) / 141);
  EXPECT_GE(logs.least, -2 - 1e-12);  // rounding of the logarithm
  EXPECT_LE(logs.greatest, 2 + 1e-12);
}

// Each of both components of the tilt has the deviation asked for, so that the mean square of the angle is twice its
// square: 2 (0.05)^2 with a standard error of 1 / sqrt(20000) of it.
TEST(Rows, TiltTheAttitude) {
  Spec spec = one_variation(Distribution::kTilt, 0.05, 0);
  spec.vary[0].values = {list_node({0.6, 0.0, 0.0, 0.8})};
  double squares = 0;
  for (std::uint64_t i = 0; i < spec.rows(); ++i) {
    const Row row = make_row(spec, i);
    const auto& q = row.values[0].items;
    const double up = 1 - 2 * (q[1].number * q[1].number + q[2].number * q[2].number);  // of the body's third axis
    squares += std::pow(std::acos(std::min(up, 1.0)), 2);
  }
  EXPECT_NEAR(squares / 20000 / (2 * 0.05 * 0.05), 1, 5 / std::sqrt(20000.0));
}

TEST(Rows, DependOnSeedAndNumberAlone) {
  const Spec spec = test::spec_of(test::kPaperSweep);
  ASSERT_EQ(spec.rows(), 120u);
  Spec more = spec;
  more.repeats = 1000;
  more.vary.push_back({"duration", Distribution::kUniform, 1, 2, {}, 0});  // another key changes no value of these
  std::set<std::uint64_t> seeds;
  for (std::uint64_t i = 0; i < 40; ++i) {
    const Row row = make_row(spec, i), again = make_row(more, i);
    EXPECT_EQ(row.seed, again.seed);
    EXPECT_LT(row.seed, std::uint64_t{1} << 53);
    for (std::size_t v = 0; v < spec.vary.size(); ++v) EXPECT_EQ(row.values[v].number, again.values[v].number);
    seeds.insert(row.seed);
  }
  EXPECT_EQ(seeds.size(), 40u);
  Spec other = spec;
  other.seed = 2;
  EXPECT_NE(make_row(spec, 3).values[0].number, make_row(other, 3).values[0].number);
}

TEST(Rows, GoThroughGridsInOrder) {
  Spec spec = test::spec_of(
      "scenario = \"paper_ball\"\nruns = 2\n[vary]\nduration = { grid = [1, 2] }\n"
      "\"surface.static_friction\" = { grid = [0.31, 0.32, 0.33] }\n");
  ASSERT_EQ(spec.rows(), 12u);
  std::vector<std::pair<double, double>> seen;
  for (std::uint64_t i = 0; i < 12; i += 2) {
    const Row row = make_row(spec, i), twin = make_row(spec, i + 1);
    EXPECT_EQ(row.values[0].number, twin.values[0].number);
    EXPECT_EQ(row.values[1].number, twin.values[1].number);
    EXPECT_NE(row.seed, twin.seed);
    seen.emplace_back(row.values[0].number, row.values[1].number);
  }
  EXPECT_EQ(seen, (std::vector<std::pair<double, double>>{{1, .31}, {1, .32}, {1, .33}, {2, .31}, {2, .32}, {2, .33}}));
}

}  // namespace
}  // namespace ballast::sweep
