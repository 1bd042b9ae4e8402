// The scenario of a row. The sweep's scenario is parsed once; a row's values are put into a copy of its tree.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sim/scenario/scenario.h"
#include "tools/sweep/rows.h"

namespace ballast::sweep {

class RowScenarios {
 public:
  // `spec` must outlive the object; its base_toml is that of a scenario that has been read.
  explicit RowScenarios(const Spec& spec);

  // The scenario as `ballast run` reads it. Errors of varied keys name the sweep file and its line.
  [[nodiscard]] sim::ScenarioResult make(const Row& row) const;
  // A scenario file of the row.
  [[nodiscard]] std::string toml(const Row& row) const;
  // The value of a dotted key in the scenario; nullptr: the file does not have it.
  [[nodiscard]] const sim::Node* find(const std::string& key) const;

 private:
  [[nodiscard]] std::vector<std::string> overrides_of(const Row& row) const;  // as of --set
  [[nodiscard]] sim::Node tree_of(const Row& row, std::vector<sim::ScenarioError>& errors) const;

  const Spec& spec_;
  sim::Node base_;
};

}  // namespace ballast::sweep
