#include "tools/sweep/rows.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "sim/scenario/reader.h"
#include "tools/sweep/normal_quantile.h"
#include "tools/sweep/philox.h"

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

// The attitude, turned about a horizontal axis. Both components of the rotation vector are normal.
sim::Node tilted(const Variation& v, std::uint64_t seed, std::uint64_t number) {
  const auto draw = [&](const char* axis) {
    return v.a * normal_quantile(unit_interval(random_bits(seed, v.key + axis, number)));
  };
  const double x = draw("/1"), y = draw("/2"), angle = std::hypot(x, y);
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
    if (v.distribution == Distribution::kGrid) {
      row.values[i] = v.values[point % v.values.size()];
      point /= v.values.size();
    } else if (v.distribution == Distribution::kTilt) {
      row.values[i] = tilted(v, spec.seed, number);
    } else {
      row.values[i] = value_at(v, unit_interval(random_bits(spec.seed, v.key, number)));
    }
  }
  return row;
}

}  // namespace ballast::sweep
