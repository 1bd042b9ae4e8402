// Latin hypercubes, Sobol's sequence and correlated values.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "tests/sweep/sweeps.h"
#include "tools/sweep/normal_quantile.h"
#include "tools/sweep/permutation.h"
#include "tools/sweep/rows.h"
#include "tools/sweep/sobol.h"

namespace ballast::sweep {
namespace {

TEST(Permutation, TakesEachPlaceOnce) {
  for (const std::uint64_t count : {1u, 2u, 3u, 16u, 17u, 255u, 256u, 257u, 1000u}) {
    std::set<std::uint64_t> seen;
    for (std::uint64_t i = 0; i < count; ++i) seen.insert(permuted(i, count, 42));
    EXPECT_EQ(seen.size(), count);
    EXPECT_LT(*seen.rbegin(), count);
  }
  EXPECT_LT(permuted((std::uint64_t{1} << 53) - 1, std::uint64_t{1} << 53, 1), std::uint64_t{1} << 53);
}

// Over 6000 keys each place is equally likely for the first one: chi-square with 5 degrees of freedom, which stays
// below 20.5 with probability 0.999.
TEST(Permutation, TakesEachPlaceEquallyOften) {
  std::array<double, 6> counts{};
  for (std::uint64_t key = 0; key < 6000; ++key) ++counts[permuted(0, 6, key)];
  double chi_square = 0;
  for (const double count : counts) chi_square += (count - 1000) * (count - 1000) / 1000;
  EXPECT_LT(chi_square, 20.5);
}

// Points of scipy.stats.qmc.Sobol (scipy 1.10.1, scramble=False, bits=30), which has the same direction numbers.
TEST(Sobol, GivesTheKnownPoints) {
  const std::array<std::size_t, 6> dimensions{0, 1, 2, 3, 39, 63};
  const std::array<std::array<double, 6>, 3> first{
      {{0.5, 0.5, 0.5, 0.5, 0.5, 0.5}, {0.75, 0.25, 0.25, 0.25, 0.25, 0.75}, {0.25, 0.75, 0.75, 0.75, 0.75, 0.25}}};
  for (std::size_t i = 0; i < first.size(); ++i) {
    for (std::size_t d = 0; d < dimensions.size(); ++d)
      EXPECT_EQ(static_cast<double>(sobol_bits(dimensions[d], i + 1)) * 0x1p-64, first[i][d]) << i << " " << d;
  }
  const std::array<std::pair<std::size_t, std::uint64_t>, 6> later{
      {{0, 296862720}, {1, 603356160}, {2, 83747840}, {9, 4725760}, {39, 280685568}, {63, 330843136}}};
  for (const auto& [dimension, bits] : later) EXPECT_EQ(sobol_bits(dimension, 1000003) >> 34, bits) << dimension;
}

// Each dimension is a (0, 1)-sequence: 2^k points from a multiple of 2^k on have one in each of 2^k equal intervals.
TEST(Sobol, FillsEveryInterval) {
  for (std::size_t d = 0; d < kSobolDimensions; ++d) {
    std::set<std::uint64_t> intervals;
    for (std::uint64_t i = 0; i < 1024; ++i) intervals.insert(sobol_bits(d, (std::uint64_t{5} << 40) + i) >> 54);
    EXPECT_EQ(intervals.size(), 1024u) << d;
  }
}

const std::string kUniformSweep = R"(
scenario = "paper_ball"
runs = 64
seed = 3
[vary]
"mass.0.mass" = { uniform = [0.0, 1.0] }
"surface.static_friction" = { uniform = [0.0, 1.0] }
duration = { grid = [1, 2] }
)";

Spec sampled(const std::string& sampling) { return test::spec_of("sampling = \"" + sampling + "\"\n" + kUniformSweep); }

// One value in each of 64 parts of the range, at each point of the grid, in another order for each key and point.
TEST(Sampling, PutsOneValueIntoEachPart) {
  for (const std::string sampling : {"latin_hypercube", "sobol"}) {
    const Spec spec = sampled(sampling);
    for (const std::uint64_t point : {0u, 1u}) {
      for (const std::size_t key : {0u, 1u}) {
        std::set<int> parts;
        for (std::uint64_t i = 0; i < 64; ++i)
          parts.insert(static_cast<int>(64 * make_row(spec, 64 * point + i).values[key].number));
        EXPECT_EQ(parts.size(), 64u) << sampling;
      }
    }
    EXPECT_NE(make_row(spec, 5).values[0].number, make_row(spec, 69).values[0].number);
    EXPECT_NE(make_row(spec, 5).values[0].number, make_row(spec, 5).values[1].number);
    Spec other = spec;
    other.seed = 4;
    EXPECT_NE(make_row(spec, 5).values[0].number, make_row(other, 5).values[0].number);
  }
}

// The mean of x y over the unit square is 1/4. The standard deviation of x y is sqrt(7)/12 = 0.22, so that 4096
// independent points miss it by 0.0034; Sobol points by about log(n)^2 / n, here at most 0.001.
TEST(Sampling, SobolConvergesFaster) {
  Spec spec = sampled("sobol");
  spec.repeats = 4096;
  double sum = 0;
  for (std::uint64_t i = 0; i < spec.repeats; ++i) {
    const Row row = make_row(spec, i);
    sum += row.values[0].number * row.values[1].number;
  }
  EXPECT_NEAR(sum / 4096, 0.25, 0.001);
}

TEST(Sampling, LeavesTheSeedsAlone) {
  EXPECT_EQ(make_row(sampled("random"), 9).seed, make_row(sampled("sobol"), 9).seed);
}

const std::string kCorrelatedSweep = R"(
scenario = "paper_ball"
runs = 20000
seed = 5
correlation = [["mass.0.mass", "mass.1.mass", 0.8], ["mass.1.mass", "duration", -0.3]]
[vary]
"mass.0.mass" = { normal = [3.0, 0.5] }
"mass.1.mass" = { normal = [2.0, 0.1] }
duration = { uniform = [1, 2] }
"surface.static_friction" = { uniform = [0.1, 0.5] }
)";

// Five standard errors of 20,000 draws: (1 - r^2) / 141 for a correlation r.
TEST(Correlation, IsTheOneAskedFor) {
  const Spec spec = test::spec_of(kCorrelatedSweep);
  Spec free = spec;
  free.copula = {};
  std::array<std::array<double, 4>, 4> products{};
  for (std::uint64_t i = 0; i < spec.rows(); ++i) {
    const Row row = make_row(spec, i);
    const std::array<double, 4> z{(row.values[0].number - 3) / 0.5, (row.values[1].number - 2) / 0.1,
                                  normal_quantile(row.values[2].number - 1),
                                  normal_quantile((row.values[3].number - 0.1) / 0.4)};
    for (std::size_t j = 0; j < 4; ++j) {
      for (std::size_t k = 0; k < 4; ++k) products[j][k] += z[j] * z[k] / 20000;
    }
    EXPECT_EQ(row.values[3].number, make_row(free, i).values[3].number);  // not correlated
  }
  const double expected[4][4] = {{1, 0.8, 0, 0}, {0.8, 1, -0.3, 0}, {0, -0.3, 1, 0}, {0, 0, 0, 1}};
  for (std::size_t j = 0; j < 4; ++j) {
    for (std::size_t k = 0; k < 4; ++k) {
      const double r = expected[j][k], error = j == k ? std::numbers::sqrt2 : 1 - r * r;
      EXPECT_NEAR(products[j][k], r, 5 * std::max(error, 0.9) / 141) << j << k;
    }
  }
}

TEST(Correlation, GoesWithEverySampling) {
  for (const std::string sampling : {"latin_hypercube", "sobol"}) {
    const Spec spec = test::spec_of("sampling = \"" + sampling + "\"\n" + kCorrelatedSweep);
    double product = 0;
    for (std::uint64_t i = 0; i < spec.rows(); ++i) {
      const Row row = make_row(spec, i);
      product += (row.values[0].number - 3) / 0.5 * ((row.values[1].number - 2) / 0.1) / 20000;
    }
    EXPECT_NEAR(product, 0.8, 5 * 0.9 / 141) << sampling;
  }
}

TEST(Sampling, WrittenOutIsTheSameSweep) {
  const Spec spec = test::spec_of("sampling = \"sobol\"\n" + kCorrelatedSweep);
  std::string text = to_toml(spec);
  const std::string stored = "scenario = \"scenario.toml\"";
  text.replace(text.find(stored), stored.size(), "scenario = \"paper_ball\"");
  const Spec again = test::spec_of(text);
  EXPECT_EQ(to_toml(again), to_toml(spec));
  EXPECT_EQ(make_row(again, 77).values[1].number, make_row(spec, 77).values[1].number);
  EXPECT_NE(identity(spec), identity(test::spec_of(kCorrelatedSweep)));
}

TEST(Sampling, IsRefusedWithWhatIsAllowed) {
  const std::string rest =
      "\nscenario = \"paper_ball\"\nruns = 9\n[vary]\nduration = { uniform = [1, 2] }\n"
      "\"mass.0.mass\" = { normal = [1, 0.1] }\n\"mass.1.mass\" = { normal = [1, 0.1] }\n"
      "\"mass.2.mass\" = { choice = [1, 2] }\n";
  const std::pair<const char*, const char*> refusals[] = {
      {"sampling = \"halton\"", "sampling = \"halton\": is no sampling; allowed: random, latin_hypercube, sobol"},
      {"sampling = 3", "sampling = 3"},
      {"correlation = 0.5", "is no list; allowed: an array of [\"key\", \"another key\", correlation]"},
      {"correlation = [[\"duration\", \"mass.0.mass\"]]", "is no correlation; allowed: [\"key\""},
      {"correlation = [[\"duration\", \"mass.0.mas\", 0.5]]", "names mass.0.mas, which [vary] does not vary"},
      {"correlation = [[\"duration\", \"mass.2.mass\", 0.5]]", "names mass.2.mass, which is neither normal"},
      {"correlation = [[\"duration\", \"duration\", 0.5]]", "names one key twice"},
      {"correlation = [[\"duration\", \"mass.0.mass\", 1.0]]", "is out of range"},
      {"correlation = [[\"duration\", \"mass.0.mass\", 0.1], [\"mass.0.mass\", \"duration\", 0.1]]", "is given twice"},
      {"correlation = [[\"duration\", \"mass.0.mass\", 0.9], [\"mass.0.mass\", \"mass.1.mass\", 0.9], "
       "[\"duration\", \"mass.1.mass\", -0.9]]",
       "is not positive definite (least eigenvalue -0.8)"},
  };
  for (const auto& [line, words] : refusals) {
    const std::string errors = test::errors_of(line + rest);
    EXPECT_NE(errors.find(words), std::string::npos) << line << "\nsays: " << errors;
    EXPECT_TRUE(errors.starts_with("test.toml:1: ")) << errors;
  }
  std::string many = "sampling = \"sobol\"\nscenario = \"paper_ball\"\nruns = 9\n[vary]\n";
  for (int i = 0; i < 65; ++i) many += "\"x" + std::to_string(i) + "\" = { uniform = [0, 1] }\n";
  EXPECT_NE(test::errors_of(many).find("has too many keys in [vary]: 65 random numbers; allowed: at most 64"),
            std::string::npos);
}

}  // namespace
}  // namespace ballast::sweep
