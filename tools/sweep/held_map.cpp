#include "tools/sweep/held_map.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tools/sweep/netcdf_file.h"
#include "tools/sweep/results.h"

namespace ballast::sweep {
namespace {

constexpr std::size_t kMostValues = 400;  // of a grid whose values are cells of their own
constexpr double kRunsPerCell = 10;       // wanted on average where a range is divided
constexpr double kLeastCells = 5, kMostCells = 80;

bool of_numbers(const Variation& v) {
  if (v.distribution == Distribution::kTilt) return false;
  return v.values.empty() || v.values.front().kind == sim::NodeKind::kFloat ||
         v.values.front().kind == sim::NodeKind::kInteger;
}

// One side of the map.
struct Axis {
  std::string key;
  bool logarithmic = false;
  std::vector<double> edges;   // of the cells, ascending
  std::vector<double> values;  // of a grid or choice whose values are the cells; empty: a range

  // The cell of a value; -1: outside.
  [[nodiscard]] int cell_of(double value) const {
    const auto after = std::upper_bound(edges.begin(), edges.end(), value);
    if (after == edges.end()) return value == edges.back() ? static_cast<int>(edges.size()) - 2 : -1;
    return static_cast<int>(after - edges.begin()) - 1;
  }
  [[nodiscard]] std::size_t cells() const { return edges.size() - 1; }
};

// Edges halfway between the values. A single value gets a cell of width 1.
std::vector<double> edges_around(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  const std::size_t n = values.size();
  if (n == 1) return {values[0] - 0.5, values[0] + 0.5};
  std::vector<double> edges{values[0] - (values[1] - values[0]) / 2};
  for (std::size_t i = 0; i + 1 < n; ++i) edges.push_back((values[i] + values[i + 1]) / 2);
  edges.push_back(values[n - 1] + (values[n - 1] - values[n - 2]) / 2);
  return edges;
}

std::vector<double> divided(double low, double high, std::size_t cells, bool logarithmic) {
  std::vector<double> edges;
  for (std::size_t i = 0; i <= cells; ++i) {
    const double part = static_cast<double>(i) / static_cast<double>(cells);
    edges.push_back(logarithmic ? low * std::pow(high / low, part) : low + (high - low) * part);
  }
  edges.front() = low;
  edges.back() = high;
  return edges;
}

Axis axis_of(const Spec& spec, const std::string& key) {
  const Variation& v =
      *std::find_if(spec.vary.begin(), spec.vary.end(), [&](const Variation& x) { return x.key == key; });
  const auto cells = static_cast<std::size_t>(
      std::clamp(std::sqrt(static_cast<double>(spec.rows()) / kRunsPerCell), kLeastCells, kMostCells));
  Axis axis{key, v.distribution == Distribution::kLogUniform, {}, {}};
  if (!v.values.empty()) {
    std::vector<double> values;
    for (const sim::Node& value : v.values) values.push_back(value.number);
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const bool each = values.size() <= kMostValues;
    axis.edges = each ? edges_around(values) : divided(*low, *high, cells, false);
    if (each) axis.values = values;
  } else if (v.distribution == Distribution::kNormal) {
    const double half = v.b > 0 ? 3 * v.b : 0.5;
    axis.edges = divided(v.a - half, v.a + half, cells, false);
  } else {
    axis.edges = divided(v.a, v.b, cells, axis.logarithmic);
  }
  return axis;
}

nlohmann::ordered_json json_of(const Axis& axis) {
  return {{"key", axis.key}, {"logarithmic", axis.logarithmic}, {"edges", axis.edges}, {"values", axis.values}};
}

}  // namespace

std::pair<std::string, std::string> map_keys(const Spec& spec, const std::string& text, std::string& why) {
  const std::size_t comma = text.find(',');
  const auto trimmed = [](std::string part) {
    part.erase(0, part.find_first_not_of(' '));
    part.erase(part.find_last_not_of(' ') + 1);
    return part;
  };
  const std::string x = trimmed(text.substr(0, comma));
  const std::string y = comma == std::string::npos ? "" : trimmed(text.substr(comma + 1));
  const std::string allowed = "; allowed: X,Y, two keys of [vary] with numbers";
  if (!spec.find_limit.empty()) why = "the sweep searches a limit, so that its rows do not fill a map";
  if (why.empty() && (x.empty() || y.empty() || x == y)) why = "is no pair of keys" + allowed;
  for (const std::string& key : {x, y}) {
    const auto found =
        std::find_if(spec.vary.begin(), spec.vary.end(), [&](const Variation& v) { return v.key == key; });
    if (!why.empty()) break;
    if (found == spec.vary.end())
      why = fmt::format("{} is not varied{}", key, allowed);
    else if (!of_numbers(*found))
      why = fmt::format("{} has values that are no numbers{}", key, allowed);
  }
  return why.empty() ? std::pair{x, y} : std::pair<std::string, std::string>{};
}

std::string held_map_json(const std::string& results_file, const Spec& spec,
                          const std::pair<std::string, std::string>& keys, std::string& error) {
  const Axis x = axis_of(spec, keys.first), y = axis_of(spec, keys.second);
  std::vector<std::vector<std::uint64_t>> runs(y.cells(), std::vector<std::uint64_t>(x.cells())), held = runs;
  NetcdfFile file(results_file, NetcdfFile::Mode::kRead);
  const int x_column = file.find_variable(variable_name(keys.first));
  const int y_column = file.find_variable(variable_name(keys.second)), held_column = file.find_variable("held");
  constexpr std::uint64_t kChunk = 1 << 16;  // rows read at once
  for (std::uint64_t first = 0; first < spec.rows() && file.error().empty(); first += kChunk) {
    const std::size_t count = std::min(kChunk, spec.rows() - first);
    const std::vector<double> xs = file.numbers(x_column, first, count), ys = file.numbers(y_column, first, count);
    const std::vector<double> holds = file.numbers(held_column, first, count);
    for (std::size_t i = 0; i < count; ++i) {
      const int column = x.cell_of(xs[i]), row = y.cell_of(ys[i]);
      if (column < 0 || row < 0) continue;
      ++runs[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
      if (holds[i] > 0) ++held[static_cast<std::size_t>(row)][static_cast<std::size_t>(column)];
    }
  }
  error = file.error();
  if (!error.empty()) return "";
  const nlohmann::ordered_json json{{"sweep", spec.name},  {"scenario", spec.base_name},
                                    {"rows", spec.rows()}, {"x", json_of(x)},
                                    {"y", json_of(y)},     {"runs", runs},
                                    {"held", held}};
  return json.dump(1) + "\n";
}

}  // namespace ballast::sweep
