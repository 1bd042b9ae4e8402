#include "tools/sweep/read_spec.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

#include "sim/scenario/check.h"
#include "sim/scenario/reader.h"
#include "tools/program/program.h"
#include "tools/sweep/correlation.h"
#include "tools/sweep/kept_values.h"
#include "tools/sweep/limit_search.h"
#include "tools/sweep/row_scenario.h"
#include "tools/sweep/sobol.h"

namespace ballast::sweep {

using sim::Node;
using sim::NodeKind;
using sim::ScenarioError;
using sim::TableReader;

namespace {

constexpr const char* kAllowedVariation =
    "one of { normal = [mean, deviation] }, { uniform = [low, high] }, { log_uniform = [low, high] }, { choice = [..] "
    "}, "
    "{ grid = [..] }; of initial.orientation also { tilt = deviation in rad }";
constexpr std::size_t kMostValues = 1'000'000;  // of a grid or a choice
constexpr std::uint64_t kMostSeed = std::numeric_limits<std::int64_t>::max();

bool is_number(const Node& node) { return node.kind == NodeKind::kFloat || node.kind == NodeKind::kInteger; }

// Collects errors of one file.
class Report {
 public:
  Report(std::string source, std::vector<ScenarioError>& errors) : source_(std::move(source)), errors_(errors) {}
  void refuse(const Node& node, const std::string& key, const std::string& message) {
    errors_.push_back({source_, node.line, key, node.written, message});
  }

 private:
  std::string source_;
  std::vector<ScenarioError>& errors_;
};

// Calls `take(key, value)` for each value below `table`, with its dotted key: `"a.b" = 1` and `a.b = 1` are the same.
// `is_value` decides which tables are values.
template <class IsValue, class Take>
void for_each_value(const Node& table, const std::string& path, const IsValue& is_value, const Take& take) {
  for (const auto& [name, node] : table.entries) {
    const std::string key = path.empty() ? name : path + "." + name;
    if (node.kind == NodeKind::kTable && !is_value(node))
      for_each_value(node, key, is_value, take);
    else
      take(key, node);
  }
}

bool names_a_distribution(const Node& table) {
  return std::any_of(std::begin(kDistributionNames), std::end(kDistributionNames),
                     [&table](std::string_view name) { return table.find(name) != nullptr; });
}

// Checks the two numbers of a continuous distribution.
void read_pair(const std::string& key, const Node& node, Variation& out, Report& report) {
  const std::string path = key + "." + std::string(kDistributionNames[static_cast<std::size_t>(out.distribution)]);
  if (node.kind != NodeKind::kArray || node.items.size() != 2 || !is_number(node.items[0]) ||
      !is_number(node.items[1])) {
    return report.refuse(node, path, "is no pair of numbers; allowed: an array of 2 finite numbers");
  }
  out.a = node.items[0].number;
  out.b = node.items[1].number;
  if (!std::isfinite(out.a) || !std::isfinite(out.b)) {
    report.refuse(node, path, "is not finite; allowed: an array of 2 finite numbers");
  } else if (out.distribution == Distribution::kNormal && !(out.b >= 0)) {
    report.refuse(node, path, "has a negative deviation; allowed: [mean, deviation] with deviation >= 0");
  } else if (out.distribution != Distribution::kNormal && !(out.a < out.b)) {
    report.refuse(node, path, "has its ends in the wrong order; allowed: [low, high] with low < high");
  } else if (out.distribution == Distribution::kLogUniform && !(out.a > 0)) {
    report.refuse(node, path, "has no logarithm; allowed: [low, high] with 0 < low");
  }
}

void read_values(const std::string& key, const Node& node, Variation& out, Report& report) {
  const std::string name(kDistributionNames[static_cast<std::size_t>(out.distribution)]), path = key + "." + name;
  const std::string allowed = fmt::format("an array of 1 to {} values", kMostValues);
  if (node.kind != NodeKind::kArray) return report.refuse(node, path, "is no list; allowed: " + allowed);
  if (node.items.empty()) return report.refuse(node, path, "is empty; allowed: " + allowed);
  if (node.items.size() > kMostValues) return report.refuse(node, path, "is too long; allowed: " + allowed);
  for (const Node& item : node.items) {
    const bool same = item.kind == node.items.front().kind || (is_number(item) && is_number(node.items.front()));
    if (!same || item.kind == NodeKind::kTable || item.kind == NodeKind::kDateOrTime)
      return report.refuse(node, path, "mixes kinds of values; allowed: numbers, texts, booleans or lists of numbers");
    const bool bad_list = item.kind == NodeKind::kArray && item.items.size() != node.items.front().items.size();
    if (bad_list) return report.refuse(node, path, "mixes lists of different lengths; allowed: lists of one length");
    if (is_number(item) && std::isnan(item.number))
      return report.refuse(node, path,
                           "has a value that is no number; allowed: numbers, or inf where the key takes it");
    out.values.push_back(item);
    out.values.back().source = sim::kOverrideSource;
    out.values.back().line = 0;
  }
}

void read_tilt(const std::string& key, const Node& node, Variation& out, Report& report) {
  out.a = node.number;
  const std::string path = "vary." + key + ".tilt";
  if (key != "initial.orientation")
    report.refuse(node, path, "is no distribution of this key; allowed: of initial.orientation only");
  else if (!is_number(node) || !(out.a >= 0 && out.a <= 3))
    report.refuse(node, path, "is no angle; allowed: a standard deviation from 0 to 3, in rad");
}

void read_variation(const std::string& key, const Node& node, Spec& spec, Report& report) {
  const std::string allowed = std::string("; allowed: ") + kAllowedVariation;
  if (node.kind != NodeKind::kTable) return report.refuse(node, "vary." + key, "is no distribution" + allowed);
  if (node.entries.size() != 1) {
    return report.refuse(node, "vary." + key,
                         (node.entries.empty() ? "names no distribution" : "names more than one key") + allowed);
  }
  if (key == "seed")
    return report.refuse(node, "vary.seed",
                         "cannot be varied: every row has a seed of its own; allowed: any other key");
  const auto& [name, value] = node.entries.front();
  const auto found = std::find(std::begin(kDistributionNames), std::end(kDistributionNames), name);
  Variation v;
  v.key = key;
  v.line = node.line;
  v.distribution = static_cast<Distribution>(found - std::begin(kDistributionNames));
  if (v.distribution == Distribution::kTilt)
    read_tilt(key, value, v, report);
  else if (v.distribution == Distribution::kChoice || v.distribution == Distribution::kGrid)
    read_values("vary." + key, value, v, report);
  else
    read_pair("vary." + key, value, v, report);
  spec.vary.push_back(std::move(v));
}

// Reports tables below [vary] that hold no distribution, with the nearest name of one.
void refuse_unknown_distributions(const Node& table, const std::string& path, Report& report) {
  for (const auto& [name, node] : table.entries) {
    const std::string key = path + "." + name;
    if (node.kind != NodeKind::kTable || names_a_distribution(node)) continue;
    const bool innermost = std::none_of(node.entries.begin(), node.entries.end(),
                                        [](const auto& entry) { return entry.second.kind == NodeKind::kTable; });
    if (!innermost) {
      refuse_unknown_distributions(node, key, report);
      continue;
    }
    const std::vector<std::string> known(std::begin(kDistributionNames), std::end(kDistributionNames));
    const std::string near = node.entries.empty() ? "" : sim::nearest(node.entries.front().first, known);
    report.refuse(node, key,
                  std::string("names no distribution") + (near.empty() ? "" : " (did you mean " + near + "?)") +
                      "; allowed: " + kAllowedVariation);
  }
}

void read_vary(TableReader& root, Spec& spec, Report& report) {
  const Node* table = root.node("vary");
  if (table == nullptr) return;
  if (table->kind != NodeKind::kTable) return root.refuse("vary", "is no table; allowed: [vary]");
  refuse_unknown_distributions(*table, "vary", report);
  for_each_value(*table, "", names_a_distribution, [&](const std::string& key, const Node& node) {
    // A number below an unknown distribution has been reported with its table.
    const bool direct = node.kind == NodeKind::kTable || table->find(key) != nullptr;
    if (direct) read_variation(key, node, spec, report);
  });
  std::stable_sort(spec.vary.begin(), spec.vary.end(),
                   [](const Variation& x, const Variation& y) { return x.line < y.line; });
}

void read_set(TableReader& root, Spec& spec) {
  const Node* table = root.node("set");
  if (table == nullptr) return;
  if (table->kind != NodeKind::kTable) return root.refuse("set", "is no table; allowed: [set]");
  const auto inline_table = [](const Node& node) { return !node.written.empty(); };
  for_each_value(*table, "", inline_table, [&](const std::string& key, const Node& node) {
    spec.set.push_back({key, node});
  });
}

void read_keep(TableReader table, Spec& spec) {
  const std::string allowed = "an array of names in summary.json, such as \"mu_required.max\"";
  const Node* values = table.node("values");
  if (values == nullptr) {
    spec.keep = {"end.reason", "end.time", "mu_required.max", "normal_force.min"};
  } else if (values->kind != NodeKind::kArray) {
    table.refuse("values", "is no list; allowed: " + allowed);
  } else {
    for (std::size_t i = 0; i < values->items.size(); ++i) {
      const Node& item = values->items[i];
      const std::string why =
          item.kind == NodeKind::kString ? unknown_value(item.text) : "is no text; allowed: " + allowed;
      if (!why.empty()) table.refuse(fmt::format("values.{}", i), why);
      if (std::find(spec.keep.begin(), spec.keep.end(), item.text) == spec.keep.end()) spec.keep.push_back(item.text);
    }
  }
  table.refuse_unknown_keys();
}

void read_sampling(TableReader& root, Spec& spec) {
  root.know({"sampling"});
  if (!root.has("sampling")) return;
  const std::string name = root.text("sampling").value_or("random");
  const auto found = std::find(std::begin(kSamplingNames), std::end(kSamplingNames), name);
  if (found == std::end(kSamplingNames))
    return root.refuse("sampling", "is no sampling; allowed: random, latin_hypercube, sobol");
  spec.sampling = static_cast<Sampling>(found - std::begin(kSamplingNames));
  std::size_t dimensions = 0;
  for (const Variation& v : spec.vary) dimensions += dimensions_of(v.distribution);
  if (spec.sampling == Sampling::kSobol && dimensions > kSobolDimensions) {
    root.refuse("sampling", fmt::format("has too many keys in [vary]: {} random numbers; allowed: at most {}",
                                        dimensions, kSobolDimensions));
  }
}

// Why a key cannot be correlated; empty: it can.
std::string correlation_refusal(const Spec& spec, const std::string& key) {
  const auto found = std::find_if(spec.vary.begin(), spec.vary.end(), [&](const Variation& v) { return v.key == key; });
  if (found == spec.vary.end()) return fmt::format("names {}, which [vary] does not vary", key);
  const bool continuous = found->distribution == Distribution::kNormal ||
                          found->distribution == Distribution::kUniform ||
                          found->distribution == Distribution::kLogUniform;
  return continuous ? "" : fmt::format("names {}, which is neither normal, uniform nor log_uniform", key);
}

// Reads one ["first", "second", value].
void read_correlation(TableReader& root, const std::string& path, const Node& node, Spec& spec) {
  constexpr const char* kAllowed =
      "; allowed: [\"key\", \"another key\", correlation], both varied with normal, uniform or log_uniform, and a "
      "number "
      "between -1 and 1";
  const bool right = node.kind == NodeKind::kArray && node.items.size() == 3 &&
                     node.items[0].kind == NodeKind::kString && node.items[1].kind == NodeKind::kString &&
                     is_number(node.items[2]);
  if (!right) return root.refuse(path, std::string("is no correlation") + kAllowed);
  const Correlation c{node.items[0].text, node.items[1].text, node.items[2].number};
  for (const std::string& key : {c.first, c.second}) {
    const std::string why = correlation_refusal(spec, key);
    if (!why.empty()) return root.refuse(path, why + kAllowed);
  }
  if (c.first == c.second) return root.refuse(path, std::string("names one key twice") + kAllowed);
  if (!(std::abs(c.value) < 1)) return root.refuse(path, std::string("is out of range") + kAllowed);
  const bool known = std::any_of(spec.correlations.begin(), spec.correlations.end(), [&](const Correlation& other) {
    return (other.first == c.first && other.second == c.second) || (other.first == c.second && other.second == c.first);
  });
  if (known) return root.refuse(path, "is given twice; allowed: each pair once");
  spec.correlations.push_back(c);
}

void read_correlations(TableReader& root, Spec& spec) {
  const Node* list = root.node("correlation");
  if (list == nullptr) return;
  if (list->kind != NodeKind::kArray)
    return root.refuse("correlation", "is no list; allowed: an array of [\"key\", \"another key\", correlation]");
  for (std::size_t i = 0; i < list->items.size(); ++i)
    read_correlation(root, fmt::format("correlation.{}", i), list->items[i], spec);
  const std::string why = factor_correlations(spec);
  if (!why.empty()) root.refuse("correlation", why + "; allowed: correlations that some random numbers have");
}

void read_find_limit(TableReader& root, Spec& spec) {
  root.know({"find_limit"});
  if (!root.has("find_limit")) return;
  spec.find_limit = root.text("find_limit").value_or("");
  const std::string why = limit_refusal(spec, spec.find_limit);
  if (!why.empty()) root.refuse("find_limit", why);
}

void read_counts(TableReader& root, Spec& spec) {
  const auto seed = root.integer("seed", 0, kMostSeed, 0);
  spec.seed = static_cast<std::uint64_t>(seed.value_or(0));
  const bool has_grid = std::any_of(spec.vary.begin(), spec.vary.end(),
                                    [](const Variation& v) { return v.distribution == Distribution::kGrid; });
  root.know({"runs"});
  if (!root.has("runs") && !has_grid) {
    return root.refuse("runs", "is missing; allowed: an integer from 1, or a grid in [vary]");
  }
  const auto runs = root.integer("runs", 1, kMostRuns, 1);
  spec.repeats = static_cast<std::uint64_t>(runs.value_or(1));
  std::uint64_t rows = spec.repeats;
  for (const Variation& v : spec.vary) {
    if (v.distribution != Distribution::kGrid || v.values.empty()) continue;
    if (rows > kMostRuns / v.values.size()) {
      return root.refuse(
          "runs", "makes too many runs with the grids; allowed: a product of at most " + std::to_string(kMostRuns));
    }
    rows *= v.values.size();
  }
}

// The scenario's file: beside the sweep file, or one that ships.
std::string base_file(const std::string& name, const std::filesystem::path& folder, std::string& why) {
  std::error_code code;
  for (const std::string ending : {"", ".toml"}) {
    const std::filesystem::path beside = folder / (name + ending);
    if (std::filesystem::is_regular_file(beside, code)) return beside.string();
  }
  return program::scenario_file(name, why);
}

// Lists of numbers that are zeros where a scenario leaves them out, so that one of their numbers can be varied.
constexpr std::pair<std::string_view, int> kZeros[] = {
    {"initial.angular_velocity", 3}, {"initial.position", 2}, {"external_force", 3}, {"ball.center_of_mass", 3}};

// Adds the lists that the file leaves out and the sweep needs, as overrides.
void add_zeros(const std::string& file, const Spec& spec, std::vector<std::string>& overrides) {
  const sim::ScenarioResult plain = sim::read_scenario(file);
  Spec base;
  base.base_toml = plain.scenario.toml;
  if (!plain.ok()) return;
  const RowScenarios rows(base);
  for (const auto& [list, count] : kZeros) {
    const std::string inside = std::string(list) + ".";
    const bool wanted =
        std::any_of(spec.vary.begin(), spec.vary.end(),
                    [&](const Variation& v) { return v.key.starts_with(inside); }) ||
        std::any_of(spec.set.begin(), spec.set.end(), [&](const Setting& set) { return set.key.starts_with(inside); });
    if (wanted && rows.find(std::string(list)) == nullptr)
      overrides.push_back(std::string(list) + (count == 2 ? "=[0.0, 0.0]" : "=[0.0, 0.0, 0.0]"));
  }
}

// Reads the scenario with [set] applied. Errors of [set] name the sweep file.
void read_base(const std::string& file, Spec& spec, std::vector<ScenarioError>& errors) {
  std::vector<std::string> overrides;
  add_zeros(file, spec, overrides);
  for (const Setting& setting : spec.set) overrides.push_back(setting.key + "=" + toml_value(setting.value));
  sim::ScenarioResult base = sim::read_scenario(file, overrides);
  for (ScenarioError& error : base.errors) {
    for (const Setting& setting : spec.set) {
      if (error.source != sim::kOverrideSource || !(error.key + ".").starts_with(setting.key + ".")) continue;
      error.source = spec.source;
      error.line = setting.value.line;
    }
    errors.push_back(error);
  }
  spec.base_name = base.scenario.name;
  spec.base_toml = base.scenario.toml;
}

// Gives tilts the attitude that they tilt.
void find_attitudes(Spec& spec) {
  const RowScenarios rows(spec);
  const Node* base = rows.find("initial.orientation");
  for (Variation& v : spec.vary) {
    if (v.distribution == Distribution::kTilt) v.values = {base != nullptr ? *base : list_node({1, 0, 0, 0})};
  }
}

void check_names(const Spec& spec, std::vector<ScenarioError>& errors) {
  for (const Variation& v : spec.vary) {
    for (const Setting& setting : spec.set) {
      if (setting.key == v.key && setting.value.line > 0)
        errors.push_back({spec.source, setting.value.line, "set." + v.key, setting.value.written,
                          "is varied too; allowed: in [set] or in [vary]"});
    }
  }
  std::vector<std::string> names{"row", "seed", "exit_status", "held"};
  const auto add = [&](const std::string& key, int line) {
    const std::string name = variable_name(key);
    if (std::find(names.begin(), names.end(), name) != names.end()) {
      errors.push_back(
          {spec.source, line, key, "",
           "would be written as " + name + ", which another column of sweep.nc is called; allowed: each once"});
    }
    names.push_back(name);
  };
  for (const Variation& v : spec.vary) add(v.key, v.line);
  for (const std::string& key : columns_of(spec)) add(key, 0);
}

// Refuses texts, booleans and lists that the scenario's check refuses whatever the other keys are. Numbers may depend
// on them.
void check_values(const Spec& spec, const RowScenarios& rows, std::vector<ScenarioError>& errors) {
  constexpr std::size_t kMostTried = 1000;
  for (std::size_t k = 0; k < spec.vary.size(); ++k) {
    const Variation& v = spec.vary[k];
    const bool chosen = v.distribution == Distribution::kChoice || v.distribution == Distribution::kGrid;
    if (!chosen || v.values.size() > kMostTried || is_number(v.values.front())) continue;
    Row row = make_row(spec, 0);
    for (const Node& value : v.values) {
      row.values[k] = value;
      for (const ScenarioError& error : rows.make(row).errors) {
        if (error.key == v.key) errors.push_back({spec.source, v.line, "vary." + v.key, value.written, error.message});
      }
    }
  }
}

// Refuses distributions of numbers for keys that are texts.
void check_kinds(const Spec& spec, const RowScenarios& rows, std::vector<ScenarioError>& errors) {
  for (const Variation& v : spec.vary) {
    const Node* base = rows.find(v.key);
    if (base == nullptr || !v.values.empty() || is_number(*base)) continue;
    const char* kind = base->kind == NodeKind::kString    ? "a text"
                       : base->kind == NodeKind::kBoolean ? "a boolean"
                       : base->kind == NodeKind::kArray   ? "a list"
                                                          : "a table";
    errors.push_back({spec.source, v.line, "vary." + v.key, base->written,
                      fmt::format("is {} in the scenario, which no distribution of numbers gives; allowed: choice or "
                                  "grid, or one of its numbers",
                                  kind)});
  }
}

}  // namespace

void complete_spec(const std::string& file, Spec& spec, std::vector<ScenarioError>& errors) {
  read_base(file, spec, errors);
  if (!errors.empty()) return;
  find_attitudes(spec);
  check_names(spec, errors);
  const RowScenarios rows(spec);
  check_kinds(spec, rows, errors);
  check_values(spec, rows, errors);
  if (!errors.empty()) return;
  // A key that the scenario does not know is refused in every row, so that the first ones tell.
  constexpr std::uint64_t kTried = 20;
  std::vector<ScenarioError> first;
  for (std::uint64_t number = 0; number < std::min(kTried, spec.rows()); ++number) {
    const sim::ScenarioResult row = rows.make(make_row(spec, number));
    if (row.ok()) return;
    if (number == 0) first = row.errors;
  }
  errors.insert(errors.end(), first.begin(), first.end());
}

// A scenario or a run's file in place of a sweep; empty: it may be a sweep.
std::string scenario_in_place_of_sweep(const Node& tree) {
  const bool scenario =
      tree.find("ball") != nullptr && tree.find("vary") == nullptr && tree.find("scenario") == nullptr;
  return scenario ? "is a scenario; allowed: a sweep file, or a scenario with --errors" : "";
}

std::optional<Spec> parse_spec(const std::string& toml, const std::string& source, const std::filesystem::path& folder,
                               std::vector<ScenarioError>& errors) {
  Node tree;
  if (!sim::read_tree(toml, source, tree, errors)) return std::nullopt;
  if (const std::string why = scenario_in_place_of_sweep(tree); !why.empty()) {
    errors.push_back({source, 0, "", "", why});
    return std::nullopt;
  }
  Spec spec;
  spec.source = source;
  std::vector<ScenarioError> warnings;
  sim::ReadContext context{source, errors, warnings};
  TableReader root(&tree, "", context);
  Report report(source, errors);
  const auto scenario = root.text("scenario");
  root.know({"name"});
  // A name that is no text has been refused: any other will do.
  spec.name = root.has("name") ? root.text("name").value_or("refused") : sim::default_name(source);
  if (!sim::usable_as_folder(spec.name))
    root.refuse("name", std::string("cannot name a folder; allowed: ") + sim::kFolderNames);
  read_set(root, spec);
  read_vary(root, spec, report);
  read_counts(root, spec);
  read_sampling(root, spec);
  read_correlations(root, spec);
  read_find_limit(root, spec);
  read_keep(root.table("keep"), spec);
  root.refuse_unknown_keys();
  if (scenario) {
    std::string why;
    const std::string file = base_file(*scenario, folder, why);
    if (file.empty())
      root.refuse("scenario", "names " + why);
    else if (errors.empty())
      complete_spec(file, spec, errors);
  }
  std::stable_sort(errors.begin(), errors.end(),
                   [](const ScenarioError& x, const ScenarioError& y) { return x.line < y.line; });
  return errors.empty() ? std::optional(std::move(spec)) : std::nullopt;
}

std::optional<Spec> read_spec(const std::filesystem::path& file, std::vector<ScenarioError>& errors) {
  std::error_code code;
  if (!std::filesystem::is_regular_file(file, code)) {
    const bool is_there = std::filesystem::exists(file, code);
    errors.push_back({file.string(), 0, "", "",
                      std::string(is_there ? "is no file" : "no such file") +
                          "; allowed: a sweep file (TOML), or with --errors a scenario"});
    return std::nullopt;
  }
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  if (!stream) {
    errors.push_back({file.string(), 0, "", "", "cannot be read; allowed: a readable TOML file"});
    return std::nullopt;
  }
  return parse_spec(text.str(), file.string(), file.parent_path(), errors);
}

}  // namespace ballast::sweep
