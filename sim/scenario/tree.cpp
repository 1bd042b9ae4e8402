#include "sim/scenario/tree.h"

#include <fmt/core.h>
#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <sstream>

namespace ballast::sim {
namespace {

constexpr std::size_t kMaxWritten = 60;       // characters of a value repeated in a message
constexpr std::size_t kMaxDescription = 200;  // characters of the TOML parser's message
constexpr std::size_t kMaxKeyParts = 16;      // no scenario key is half as deep

std::string one_line(std::string_view text, std::size_t longest = kMaxWritten) {
  std::string out;
  for (const char c : text) {
    const bool space = c == ' ' || c == '\t' || c == '\n' || c == '\r';
    if (!space) {
      out += c;
    } else if (!out.empty() && out.back() != ' ') {
      out += ' ';
    }
    if (out.size() > longest + 1) break;  // cut below; a long text is repeated in every enclosing array
  }
  while (!out.empty() && out.back() == ' ') out.pop_back();
  if (out.size() > longest) {
    std::size_t cut = longest;
    while (cut > 0 && (static_cast<unsigned char>(out[cut]) & 0xC0) == 0x80) --cut;  // not inside a UTF-8 character
    out.resize(cut);
    out += "...";
  }
  return out;
}

// The line of the first key with more parts than any scenario key; 0: none. toml++ 3.3 limits the nesting of values,
// but not the parts of a dotted key, which it splits recursively: some hundred thousand overflow the stack. Text that
// is not TOML may be misread here only beyond the place where toml++ stops.
int line_of_too_deep_key(std::string_view text) {
  int line = 1;
  std::size_t parts = 1;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '#') {
      i = std::min(text.find('\n', i), text.size()) - 1;
    } else if (c == '"' || c == '\'') {
      const bool long_quotes = text.substr(i, 3) == std::string(3, c);
      const std::size_t quotes = long_quotes ? 3 : 1;
      for (i += quotes; i < text.size() && text.substr(i, quotes) != std::string(quotes, c); ++i) {
        if (c == '"' && text[i] == '\\') ++i;
        if (i < text.size() && text[i] == '\n') {
          ++line;
          if (!long_quotes) return 0;
        }
      }
      i += quotes - 1;
      // Up to two more quotes belong to a text that ends with them.
      while (long_quotes && i + 1 < text.size() && text[i + 1] == c) ++i;
    } else if (c == '.') {
      if (++parts > kMaxKeyParts) return line;
    } else if (c == '\n' || c == ',' || c == '=' || c == '[' || c == '{') {
      parts = 1;
      if (c == '\n') ++line;
    }
  }
  return 0;
}

// The text behind toml++'s source regions: lines and columns from 1, columns counted in Unicode characters.
class SourceText {
 public:
  explicit SourceText(std::string_view text) : text_(text) {
    for (std::size_t i = 0; i < text.size(); ++i) {
      if (i == 0 || text[i - 1] == '\n') line_start_.push_back(character_start_.size());
      if ((static_cast<unsigned char>(text[i]) & 0xC0) != 0x80) character_start_.push_back(i);
    }
  }

  [[nodiscard]] std::string_view slice(const toml::source_region& region) const {
    const std::size_t begin = offset(region.begin), end = offset(region.end);
    return begin < end ? text_.substr(begin, end - begin) : std::string_view{};
  }

 private:
  // Takes constant time, because a line may be the whole file.
  [[nodiscard]] std::size_t offset(const toml::source_position& position) const {
    if (position.line < 1 || position.line > line_start_.size()) return text_.size();
    const std::size_t character = line_start_[position.line - 1] + std::max<std::size_t>(position.column, 1) - 1;
    return character < character_start_.size() ? character_start_[character] : text_.size();
  }

  std::string_view text_;
  std::vector<std::size_t> line_start_;       // its first character
  std::vector<std::size_t> character_start_;  // bytes
};

// The first value nested deeper than `levels`; nullptr: none. toml++ limits nested brackets and the function above the
// parts of a key, but dotted keys inside brackets still multiply to thousands of levels.
const toml::node* deeper_than(std::size_t levels, const toml::node& from) {
  if (levels == 0) return &from;
  if (const toml::table* table = from.as_table()) {
    for (const auto& [key, value] : *table) {
      if (const toml::node* found = deeper_than(levels - 1, value)) return found;
    }
  } else if (const toml::array* array = from.as_array()) {
    for (const toml::node& item : *array) {
      if (const toml::node* found = deeper_than(levels - 1, item)) return found;
    }
  }
  return nullptr;
}

// Converts a value whose nesting has been checked.
Node convert(const toml::node& from, const SourceText& text, const std::string& source, bool with_lines) {
  Node to;
  to.source = source;
  if (with_lines) to.line = static_cast<int>(from.source().begin.line);
  const std::string_view slice = text.slice(from.source());
  if (const toml::table* table = from.as_table()) {
    to.kind = NodeKind::kTable;
    // Only an inline table's text is its value; the region of a [header] is the header.
    if (table->is_inline()) to.written = one_line(slice);
    for (const auto& [key, value] : *table) {
      to.entries.emplace_back(std::string(key.str()), convert(value, text, source, with_lines));
    }
  } else if (const toml::array* array = from.as_array()) {
    to.kind = NodeKind::kArray;
    for (const toml::node& item : *array) to.items.push_back(convert(item, text, source, with_lines));
    const bool of_headers = !array->empty() && array->front().is_table() && !array->front().as_table()->is_inline();
    if (!of_headers) to.written = one_line(slice);
  } else {
    to.written = one_line(slice);
    if (const auto* string = from.as_string()) {
      to.kind = NodeKind::kString;
      to.text = string->get();
    } else if (const auto* integer = from.as_integer()) {
      to.kind = NodeKind::kInteger;
      to.integer = integer->get();
      to.number = static_cast<double>(to.integer);
    } else if (const auto* number = from.as_floating_point()) {
      to.kind = NodeKind::kFloat;
      to.number = number->get();
    } else if (const auto* boolean = from.as_boolean()) {
      to.kind = NodeKind::kBoolean;
      to.boolean = boolean->get();
    } else {
      to.kind = NodeKind::kDateOrTime;
    }
  }
  return to;
}

toml::array to_array(const Node& node);

toml::table to_table(const Node& node, bool is_inline);

// Calls `put` with the value in toml++'s type. Dates are left out, because no scenario has one.
template <class Put>
void with_value(const Node& node, bool is_inline, const Put& put) {
  switch (node.kind) {
    case NodeKind::kTable:
      return put(to_table(node, is_inline));
    case NodeKind::kArray:
      return put(to_array(node));
    case NodeKind::kString:
      return put(node.text);
    case NodeKind::kInteger:
      return put(node.integer);
    case NodeKind::kFloat:
      return put(node.number);
    case NodeKind::kBoolean:
      return put(node.boolean);
    case NodeKind::kDateOrTime:
      return;
  }
}

toml::array to_array(const Node& node) {
  toml::array array;
  for (const Node& item : node.items) {
    // Only entries that the file wrote as [[name]] are written so.
    with_value(item, !item.written.empty(), [&array](auto&& value) { array.push_back(value); });
  }
  return array;
}

toml::table to_table(const Node& node, bool is_inline) {
  toml::table table;
  for (const auto& [key, entry] : node.entries) {
    with_value(entry, !entry.written.empty(), [&table, &name = key](auto&& value) { table.insert(name, value); });
  }
  table.is_inline(is_inline);
  return table;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kSpace = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(kSpace);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kSpace) - begin + 1);
}

}  // namespace

Node value_node(std::string_view value, const char* source) {
  const std::string document = "x = " + std::string(value);
  try {
    if (line_of_too_deep_key(document) == 0) {
      const toml::table table = toml::parse(std::string_view(document));
      const toml::node* parsed = table.get("x");
      // More than one entry: the value went on after a line's end, and only looked like TOML.
      if (parsed != nullptr && table.size() == 1 && deeper_than(kMaxKeyParts, *parsed) == nullptr) {
        return convert(*parsed, SourceText(document), source, false);
      }
    }
  } catch (const toml::parse_error&) {
    // A bare word such as `prescribed` is no TOML value: taken as a string below.
  }
  Node node;
  node.kind = NodeKind::kString;
  node.source = source;
  node.text = value;
  node.written = one_line(value);
  return node;
}

namespace {

std::vector<std::string> split_key(std::string_view key) {
  std::vector<std::string> parts;
  while (true) {
    const std::size_t dot = key.find('.');
    parts.emplace_back(trimmed(key.substr(0, dot)));
    if (dot == std::string_view::npos) return parts;
    key.remove_prefix(dot + 1);
  }
}

bool is_number(std::string_view part) {
  return !part.empty() && std::all_of(part.begin(), part.end(), [](char c) { return c >= '0' && c <= '9'; });
}

std::optional<std::size_t> index_of(std::string_view part) {
  std::size_t index = 0;
  const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), index);
  if (!is_number(part) || error != std::errc{} || end != part.data() + part.size()) return std::nullopt;
  return index;
}

// The text of a value after a part of it has changed.
std::string rewritten(const Node& node) {
  std::ostringstream text;
  with_value(node, true, [&text](auto&& value) {
    if constexpr (std::is_base_of_v<toml::node, std::decay_t<decltype(value)>>) text << toml::toml_formatter(value);
  });
  return one_line(text.str());
}

}  // namespace

Node::Node() = default;

const Node* Node::find(std::string_view key) const {
  for (const auto& [name, node] : entries) {
    if (name == key) return &node;
  }
  return nullptr;
}

Node* Node::find(std::string_view key) { return const_cast<Node*>(std::as_const(*this).find(key)); }

const Node* Node::child(std::string_view key_or_index) const {
  if (kind == NodeKind::kTable) return find(key_or_index);
  const std::optional<std::size_t> index = index_of(key_or_index);
  return index && *index < items.size() ? &items[*index] : nullptr;
}

bool read_tree(std::string_view toml, std::string_view source_name, Node& root, std::vector<ScenarioError>& errors) {
  if (const int line = line_of_too_deep_key(toml); line != 0) {
    errors.push_back({std::string(source_name), line, "", "",
                      fmt::format("has a key of more than {} parts; no scenario key has as many", kMaxKeyParts)});
    return false;
  }
  try {
    const toml::table table = toml::parse(toml, source_name);
    if (const toml::node* deep = deeper_than(kMaxKeyParts + 1, table)) {
      errors.push_back({std::string(source_name), static_cast<int>(deep->source().begin.line), "", "",
                        fmt::format("has a value nested deeper than {}; no scenario value is as deep", kMaxKeyParts)});
      return false;
    }
    root = convert(table, SourceText(toml), std::string(source_name), true);
    root.line = 0;
    root.written.clear();
    return true;
  } catch (const toml::parse_error& error) {
    errors.push_back({std::string(source_name), static_cast<int>(error.source().begin.line), "", "",
                      "not TOML: " + one_line(error.description(), kMaxDescription)});
    return false;
  }
}

std::string to_toml(const Node& root) {
  std::ostringstream text;
  text << toml::toml_formatter(to_table(root, false));
  return text.str();
}

void apply_override(const std::string& assignment, Node& root, std::vector<ScenarioError>& errors) {
  const auto refuse = [&](std::string key, std::string value, std::string why) {
    errors.push_back({kOverrideSource, 0, std::move(key), std::move(value), std::move(why)});
  };
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos) {
    return refuse("", one_line(assignment), "has no '='; allowed: KEY=VALUE, e.g. surface.static_friction=0.17");
  }
  const std::string key(trimmed(std::string_view(assignment).substr(0, equals)));
  const std::string_view value_text = trimmed(std::string_view(assignment).substr(equals + 1));
  const std::string written = one_line(value_text);
  const std::vector<std::string> parts = split_key(key);
  if (std::any_of(parts.begin(), parts.end(), [](const std::string& part) { return part.empty(); })) {
    return refuse("", one_line(assignment), "has an empty key; allowed: KEY=VALUE with KEY e.g. mass.2.rail.radius");
  }
  if (parts.size() > kMaxKeyParts) return refuse(one_line(key), written, "is nested too deep; no key of a scenario is");

  // Follows the part of the path that exists. Missing parts are created after all checks.
  Node* node = &root;
  std::string path;
  std::vector<Node*> enclosing;
  std::size_t depth = 0;
  for (; depth < parts.size(); ++depth) {
    enclosing.push_back(node);
    const std::string& part = parts[depth];
    if (node->kind == NodeKind::kArray) {
      const std::optional<std::size_t> index = index_of(part);
      if (!index || *index >= node->items.size()) {
        const std::size_t count = node->items.size();
        return refuse(key, written,
                      fmt::format("{} has no entry \"{}\"; allowed: {}", path, one_line(part),
                                  count == 0   ? "none, as it is empty"
                                  : count == 1 ? "0"
                                               : fmt::format("0 to {}", count - 1)));
      }
      node = &node->items[*index];
    } else if (node->kind == NodeKind::kTable) {
      Node* next = node->find(part);
      if (next == nullptr) break;
      node = next;
    } else {
      return refuse(key, written, path + " is a single value and has no keys; allowed: " + path + "=VALUE");
    }
    path += (path.empty() ? "" : ".") + part;
  }
  for (std::size_t i = depth; i < parts.size(); ++i) {
    if (i > 0 && is_number(parts[i])) {
      std::string array;
      for (std::size_t j = 0; j < i; ++j) array += (j == 0 ? "" : ".") + parts[j];
      return refuse(key, written, array + " has no entries; --set changes entries but adds none");
    }
  }
  for (; depth < parts.size(); ++depth) {
    Node child;
    child.source = kOverrideSource;
    node->entries.emplace_back(parts[depth], std::move(child));
    node = &node->entries.back().second;
  }
  *node = value_node(value_text, kOverrideSource);
  // Messages repeat the values around it as they are now.
  std::for_each(enclosing.rbegin(), enclosing.rend(), [](Node* outer) {
    if (!outer->written.empty()) outer->written = rewritten(*outer);
  });
}

}  // namespace ballast::sim
