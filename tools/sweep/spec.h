// A sweep: one scenario, what is varied in it, and which results are kept.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "sim/scenario/tree.h"

namespace ballast::sweep {

// The largest number of runs: four days of two processors at 33 us each.
inline constexpr std::uint64_t kMostRuns = 10'000'000'000;

// The same in every run.
struct Setting {
  std::string key;  // dotted scenario key
  sim::Node value;
};

inline constexpr std::string_view kDistributionNames[] = {"normal", "uniform", "log_uniform", "choice", "grid", "tilt"};
enum class Distribution { kNormal, kUniform, kLogUniform, kChoice, kGrid, kTilt };

// The random numbers that a value takes.
constexpr std::size_t dimensions_of(Distribution distribution) {
  if (distribution == Distribution::kGrid) return 0;
  return distribution == Distribution::kTilt ? 2 : 1;
}

// One varied key.
struct Variation {
  std::string key;  // dotted scenario key
  Distribution distribution{};
  // normal: mean and standard deviation; uniform, log_uniform: both ends; tilt: standard deviation in rad, about each
  // of two horizontal axes
  double a = 0, b = 0;
  std::vector<sim::Node> values;  // choice, grid; tilt: the attitude that is tilted
  int line = 0;                   // of the sweep file
};

inline constexpr std::string_view kSamplingNames[] = {"random", "latin_hypercube", "sobol"};
enum class Sampling { kRandom, kLatinHypercube, kSobol };

// The correlation of the normal numbers behind two varied keys.
struct Correlation {
  std::string first, second;
  double value = 0;
};

// All correlations at once (correlation.h).
struct Copula {
  std::vector<std::size_t> places;  // in Spec::vary
  std::vector<double> factor;       // the lower Cholesky factor of their matrix, row by row
};

struct Spec {
  std::string name;
  std::string source;         // the sweep file, or the option that stands for one
  std::string base_name;      // of the scenario
  std::string base_toml;      // the scenario with [set] applied, as TOML
  std::uint64_t repeats = 1;  // `runs`: of random variation at each point of the grids
  std::uint64_t seed = 0;
  std::vector<Setting> set;
  std::vector<Variation> vary;    // in the order of the file
  std::vector<std::string> keep;  // names in summary.json
  Sampling sampling = Sampling::kRandom;
  std::vector<Correlation> correlations;
  Copula copula;           // of the correlations
  std::string find_limit;  // the key whose limit is searched (limit_search.h); empty: none

  [[nodiscard]] std::uint64_t grid_points() const {
    std::uint64_t points = 1;
    for (const Variation& v : vary) {
      if (v.distribution == Distribution::kGrid) points *= v.values.size();
    }
    return points;
  }
  [[nodiscard]] std::uint64_t rows() const { return grid_points() * repeats; }
};

// The columns of a row's results: spec.keep, and what a search adds.
[[nodiscard]] std::vector<std::string> columns_of(const Spec& spec);

// The name of a key's variable in sweep.nc.
[[nodiscard]] std::string variable_name(std::string key);

// The value as TOML on one line, bit for bit.
[[nodiscard]] std::string toml_value(const sim::Node& value);

// The sweep as a sweep file beside `scenario.toml`, which holds base_toml. Read again, it is the same sweep.
[[nodiscard]] std::string to_toml(const Spec& spec);

// FNV-1a of everything that decides a byte of the results.
[[nodiscard]] std::uint64_t identity(const Spec& spec);

}  // namespace ballast::sweep
