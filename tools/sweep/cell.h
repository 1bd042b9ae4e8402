// One value of a row in the results.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include "sim/scenario/tree.h"

namespace ballast::sweep {

// monostate: the run has no such value. Booleans are 0 and 1.
using Cell = std::variant<std::monostate, double, std::string, std::vector<double>>;

// A scenario's value: number, text, or list of numbers.
[[nodiscard]] inline Cell to_cell(const sim::Node& node) {
  switch (node.kind) {
    case sim::NodeKind::kFloat:
    case sim::NodeKind::kInteger:
      return node.number;
    case sim::NodeKind::kBoolean:
      return node.boolean ? 1.0 : 0.0;
    case sim::NodeKind::kString:
      return node.text;
    case sim::NodeKind::kArray: {
      std::vector<double> numbers;
      for (const sim::Node& item : node.items) numbers.push_back(item.number);
      return numbers;
    }
    case sim::NodeKind::kTable:
    case sim::NodeKind::kDateOrTime:
      break;
  }
  return {};
}

}  // namespace ballast::sweep
