// Makes nodes of a scenario's tree, for programs that write scenario files.
#pragma once

#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "sim/scenario/tree.h"

namespace ballast::sim {

// Gives a table this entry, in place of the one of that key.
inline void set_entry(Node& table, const std::string& key, Node value) {
  if (Node* old = table.find(key)) {
    *old = std::move(value);
  } else {
    table.entries.emplace_back(key, std::move(value));
  }
}

[[nodiscard]] inline Node number_node(double value) {
  Node node;
  node.kind = NodeKind::kFloat;
  node.number = value;
  return node;
}

[[nodiscard]] inline Node text_node(const std::string& value) {
  Node node;
  node.kind = NodeKind::kString;
  node.text = value;
  return node;
}

[[nodiscard]] inline Node array_node(std::vector<Node> items = {}) {
  Node node;
  node.kind = NodeKind::kArray;
  node.items = std::move(items);
  return node;
}

[[nodiscard]] inline Node numbers_node(std::initializer_list<double> values) {
  Node node = array_node();
  for (const double value : values) node.items.push_back(number_node(value));
  return node;
}

// A piece of a mass's motion: its duration, and the accelerations between which it goes linearly.
[[nodiscard]] inline Node motion_piece_node(double duration_s, double acceleration_start, double acceleration_end) {
  Node piece;
  set_entry(piece, "duration", number_node(duration_s));
  set_entry(piece, "acceleration", numbers_node({acceleration_start, acceleration_end}));
  return piece;
}

// `end` behind a scenario's name, which is shortened to what a name may have.
[[nodiscard]] inline std::string name_with(const std::string& name, const std::string& end) {
  constexpr std::size_t kLongestName = 64;
  return name.substr(0, kLongestName - end.size()) + end;
}

}  // namespace ballast::sim
