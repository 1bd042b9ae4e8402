#include "tools/sweep/row_scenario.h"

#include "sim/scenario/check.h"
#include "sim/scenario/fingerprint.h"

namespace ballast::sweep {
namespace {

// Lines of the scenario as it was written out here mean nothing to its author.
void forget_lines(sim::Node& node) {
  node.line = 0;
  for (auto& [key, entry] : node.entries) forget_lines(entry);
  for (sim::Node& item : node.items) forget_lines(item);
}

std::string override_of(const std::string& key, const sim::Node& value) {
  const bool is_number = value.kind == sim::NodeKind::kFloat || value.kind == sim::NodeKind::kInteger;
  return key + "=" + (is_number ? value.written : toml_value(value));
}

// Whether one of the keys lies inside the other.
bool related(const std::string& a, const std::string& b) {
  return (a + ".").starts_with(b + ".") || (b + ".").starts_with(a + ".");
}

}  // namespace

RowScenarios::RowScenarios(const Spec& spec) : spec_(spec) {
  std::vector<sim::ScenarioError> errors;
  sim::read_tree(spec.base_toml, spec.base_name, base_, errors);
  forget_lines(base_);
}

std::vector<std::string> RowScenarios::overrides_of(const Row& row) const {
  std::vector<std::string> overrides{"seed=" + std::to_string(row.seed)};
  for (std::size_t i = 0; i < spec_.vary.size(); ++i)
    overrides.push_back(override_of(spec_.vary[i].key, row.values[i]));
  return overrides;
}

sim::Node RowScenarios::tree_of(const Row& row, std::vector<sim::ScenarioError>& errors) const {
  sim::Node tree = base_;
  for (const std::string& assignment : overrides_of(row)) sim::apply_override(assignment, tree, errors);
  return tree;
}

sim::ScenarioResult RowScenarios::make(const Row& row) const {
  sim::ScenarioResult result;
  const sim::Node tree = tree_of(row, result.errors);
  sim::ReadContext context{spec_.base_name, result.errors, result.warnings};
  result.scenario = sim::check_scenario(tree, context);
  result.scenario.published.clear();  // numbers of the scenario that is varied
  for (sim::ScenarioError& error : result.errors) {
    if (error.source != sim::kOverrideSource) continue;
    for (const Variation& v : spec_.vary) {
      if (!related(error.key, v.key)) continue;
      error.source = spec_.source;
      error.line = v.line;
    }
  }
  if (result.ok()) result.scenario.id = sim::fingerprint(result.scenario);
  return result;
}

std::string RowScenarios::toml(const Row& row) const {
  sim::ScenarioResult read = sim::parse_scenario(spec_.base_toml, spec_.base_name, overrides_of(row));
  if (read.ok()) return read.scenario.toml;
  // Refused: the file as it would be, so that `ballast run` says why.
  std::vector<sim::ScenarioError> errors;
  return sim::to_toml(tree_of(row, errors)) + "\n";
}

const sim::Node* RowScenarios::find(const std::string& key) const {
  const sim::Node* node = &base_;
  for (std::size_t begin = 0; node != nullptr && begin <= key.size();) {
    const std::size_t dot = std::min(key.find('.', begin), key.size());
    node = node->child(key.substr(begin, dot - begin));
    begin = dot + 1;
  }
  return node;
}

}  // namespace ballast::sweep
