#include "tools/sweep/spec.h"

#include <fmt/format.h>

#include <algorithm>

#include "sim/scenario/reader.h"
#include "tools/sweep/limit_search.h"
#include "tools/sweep/philox.h"

namespace ballast::sweep {

namespace {

std::string quoted(const std::string& text) {
  sim::Node node;
  node.kind = sim::NodeKind::kString;
  node.text = node.written = text;
  return toml_value(node);
}

}  // namespace

std::vector<std::string> columns_of(const Spec& spec) {
  std::vector<std::string> columns = spec.keep;
  if (!spec.find_limit.empty()) columns.insert(columns.end(), {kLimitColumn, kLimitKindColumn});
  return columns;
}

std::string toml_value(const sim::Node& value) {
  sim::Node root;
  root.entries.emplace_back("x", value);
  if (root.entries.front().second.written.empty()) root.entries.front().second.written = "{}";  // on one line
  std::string text = sim::to_toml(root).substr(4);                                              // after "x = "
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

std::string to_toml(const Spec& spec) {
  std::string text = fmt::format("name = {}\nscenario = \"scenario.toml\"\nruns = {}\nseed = {}\n", quoted(spec.name),
                                 spec.repeats, spec.seed);
  if (spec.sampling != Sampling::kRandom)
    text += fmt::format("sampling = \"{}\"\n", kSamplingNames[static_cast<int>(spec.sampling)]);
  if (!spec.find_limit.empty()) text += fmt::format("find_limit = {}\n", quoted(spec.find_limit));
  std::string correlations;
  for (const Correlation& c : spec.correlations)
    correlations += fmt::format("  [{}, {}, {}],\n", quoted(c.first), quoted(c.second), sim::number_text(c.value));
  if (!correlations.empty()) text += "correlation = [\n" + correlations + "]\n";
  text += "\n[vary]\n";
  for (const Variation& v : spec.vary) {
    if (v.distribution == Distribution::kTilt) {
      text += fmt::format("{} = {{ tilt = {} }}\n", quoted(v.key), sim::number_text(v.a));
      continue;
    }
    std::string values;
    for (const sim::Node& value : v.values) values += (values.empty() ? "" : ", ") + toml_value(value);
    if (v.values.empty()) values = sim::number_text(v.a) + ", " + sim::number_text(v.b);
    text += fmt::format("{} = {{ {} = [{}] }}\n", quoted(v.key), kDistributionNames[static_cast<int>(v.distribution)],
                        values);
  }
  text += "\n[keep]\nvalues = [";
  for (std::size_t i = 0; i < spec.keep.size(); ++i) text += (i == 0 ? "" : ", ") + quoted(spec.keep[i]);
  return text + "]\n";
}

std::string variable_name(std::string key) {
  std::replace(key.begin(), key.end(), '.', '_');
  return key;
}

std::uint64_t identity(const Spec& spec) { return hash_of(spec.base_toml, hash_of(to_toml(spec))); }

}  // namespace ballast::sweep
