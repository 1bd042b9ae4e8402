#include "tools/sweep/rows.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sim/scenario/reader.h"
#include "tools/sweep/correlation.h"
#include "tools/sweep/normal_quantile.h"
#include "tools/sweep/permutation.h"
#include "tools/sweep/philox.h"
#include "tools/sweep/sobol.h"

namespace ballast::sweep {
namespace {

// The value whose share `u` of the distribution lies below it.
sim::Node value_at(const Variation& v, double u) {
  switch (v.distribution) {
    case Distribution::kNormal:
      return number_node(v.a + v.b * normal_quantile(u));
    case Distribution::kUniform:
      return number_node(std::clamp(v.a + (v.b - v.a) * u, v.a, v.b));
    case Distribution::kLogUniform:
      return number_node(std::clamp(std::exp(std::log(v.a) + (std::log(v.b) - std::log(v.a)) * u), v.a, v.b));
    case Distribution::kChoice:
    case Distribution::kGrid:
    case Distribution::kTilt:
      break;
  }
  const auto place = static_cast<std::size_t>(u * static_cast<double>(v.values.size()));
  return v.values[std::min(place, v.values.size() - 1)];
}

// The uniform numbers of a row. Every number has a name; `dimension` counts those of a sweep in the order of the file.
class Uniforms {
 public:
  Uniforms(const Spec& spec, std::uint64_t number)
      : spec_(spec), number_(number), repeat_(number % spec.repeats), point_(number / spec.repeats) {}

  [[nodiscard]] double at(const std::string& name, std::size_t dimension) const {
    switch (spec_.sampling) {
      case Sampling::kRandom:
        break;
      case Sampling::kLatinHypercube:
        return in_stratum(name);
      case Sampling::kSobol:
        // A random shift makes every coordinate uniform.
        return unit_interval(sobol_bits(dimension, repeat_) ^ random_bits(spec_.seed, name + "/shift", point_));
    }
    return unit_interval(random_bits(spec_.seed, name, number_));
  }

 private:
  // Each of `repeats` strata of equal size has one of the repeats, at a random place.
  [[nodiscard]] double in_stratum(const std::string& name) const {
    const std::uint64_t order = random_bits(spec_.seed, name + "/order", point_);
    const auto stratum = static_cast<double>(permuted(repeat_, spec_.repeats, order));
    const double place = unit_interval(random_bits(spec_.seed, name, number_));
    constexpr double kMost = 1 - 0x1p-53;
    return std::min((stratum + place) / static_cast<double>(spec_.repeats), kMost);
  }

  const Spec& spec_;
  std::uint64_t number_, repeat_, point_;
};

// The attitude, turned about a horizontal axis. Both components of the rotation vector are normal.
sim::Node tilted(const Variation& v, const Uniforms& uniforms, std::size_t dimension) {
  const double x = v.a * normal_quantile(uniforms.at(v.key + "/1", dimension));
  const double y = v.a * normal_quantile(uniforms.at(v.key + "/2", dimension + 1));
  const double angle = std::hypot(x, y);
  const double half = angle > 0 ? std::sin(angle / 2) / angle : 0.5;
  const std::vector<sim::Node>& q = v.values.front().items;
  const Eigen::Quaterniond attitude(q[0].number, q[1].number, q[2].number, q[3].number);
  const Eigen::Quaterniond turned = Eigen::Quaterniond(std::cos(angle / 2), half * x, half * y, 0) * attitude;
  return list_node({turned.w(), turned.x(), turned.y(), turned.z()});
}

}  // namespace

sim::Node list_node(const std::vector<double>& values) {
  sim::Node node;
  node.kind = sim::NodeKind::kArray;
  node.source = sim::kOverrideSource;
  for (const double value : values) {
    node.items.push_back(number_node(value));
    node.written += (node.written.empty() ? "[" : ", ") + node.items.back().written;
  }
  node.written += "]";
  return node;
}

sim::Node number_node(double value) {
  sim::Node node;
  node.kind = sim::NodeKind::kFloat;
  node.source = sim::kOverrideSource;
  node.number = value;
  node.written = sim::number_text(value);
  return node;
}

Row make_row(const Spec& spec, std::uint64_t number) {
  constexpr std::uint64_t kSeedBits = 53;  // exact as a double, for readers that know no other numbers
  Row row;
  row.number = number;
  row.seed = random_bits(spec.seed, "seed", number) >> (64 - kSeedBits);
  row.values.resize(spec.vary.size());
  std::uint64_t point = number / spec.repeats;
  for (std::size_t i = spec.vary.size(); i-- > 0;) {
    const Variation& v = spec.vary[i];
    if (v.distribution != Distribution::kGrid) continue;
    row.values[i] = v.values[point % v.values.size()];
    point /= v.values.size();
  }
  const Uniforms uniforms(spec, number);
  std::vector<double> uniform(spec.vary.size());
  std::size_t dimension = 0;
  for (std::size_t i = 0; i < spec.vary.size(); ++i) {
    const Variation& v = spec.vary[i];
    if (v.distribution == Distribution::kTilt)
      row.values[i] = tilted(v, uniforms, dimension);
    else if (v.distribution != Distribution::kGrid)
      uniform[i] = uniforms.at(v.key, dimension);
    dimension += dimensions_of(v.distribution);
  }
  if (!spec.copula.places.empty()) correlate(spec.copula, uniform);
  for (std::size_t i = 0; i < spec.vary.size(); ++i) {
    const Distribution of = spec.vary[i].distribution;
    if (of != Distribution::kGrid && of != Distribution::kTilt) row.values[i] = value_at(spec.vary[i], uniform[i]);
  }
  return row;
}

}  // namespace ballast::sweep
