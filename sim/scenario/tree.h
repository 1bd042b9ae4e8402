// The TOML of a scenario as a tree that remembers where each value came from, with the overrides of --set applied.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sim/scenario/scenario.h"

namespace ballast::sim {

// The kinds of TOML values. The value of a date or time is not kept, because no scenario key takes one.
enum class NodeKind { kTable, kArray, kString, kInteger, kFloat, kBoolean, kDateOrTime };

struct Node {
  Node();  // defined where Node is complete, as `entries` needs it

  NodeKind kind = NodeKind::kTable;
  std::string source;  // file name, "--set", or "--fault" with its text
  int line = 0;        // 0: not known
  std::string
      written;  // the value's text on one line, shortened if long; empty for a [table] and an [[array of tables]]

  double number = 0;         // kInteger, kFloat
  std::int64_t integer = 0;  // kInteger
  bool boolean = false;      // kBoolean
  std::string text;          // kString

  std::vector<std::pair<std::string, Node>> entries;  // kTable
  std::vector<Node> items;                            // kArray

  [[nodiscard]] const Node* find(std::string_view key) const;  // nullptr if not a table or not there
  [[nodiscard]] Node* find(std::string_view key);
  [[nodiscard]] const Node* child(std::string_view key_or_index) const;  // of a table or an array
};

inline constexpr const char* kOverrideSource = "--set";

// False, with one error added, if `toml` is not TOML.
bool read_tree(std::string_view toml, std::string_view source_name, Node& root, std::vector<ScenarioError>& errors);

// Applies one "dotted.key=value"; an error leaves the tree as it was.
void apply_override(const std::string& assignment, Node& root, std::vector<ScenarioError>& errors);

// A value as TOML if it is one, else as the bare string.
[[nodiscard]] Node value_node(std::string_view value, const char* source);

// The tree as TOML again, values bit for bit; without comments, keys in alphabetical order.
[[nodiscard]] std::string to_toml(const Node& root);

}  // namespace ballast::sim
