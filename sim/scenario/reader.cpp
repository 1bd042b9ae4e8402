#include "sim/scenario/reader.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

namespace ballast::sim {
namespace {

// Names of the kinds, in the order of NodeKind.
constexpr const char* kKindNames[] = {"a table", "an array",  "a string",      "an integer",
                                      "a float", "a boolean", "a date or time"};

std::string with_article(const std::string& text) { return "a " + text; }

// Levenshtein distance that counts two swapped neighbours as one edit (optimal string alignment).
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

// The part of a path that begins at `at`.
std::string_view part_at(std::string_view path, std::size_t at) { return path.substr(at, path.find('.', at) - at); }

// Entries of arrays are counted: their index is the one part of a path that is a number.
bool is_index(std::string_view part) { return part.find_first_not_of("0123456789") == std::string_view::npos; }

// A table as the author of a scenario writes it: "[surface.slope]", "[[fault]] 0", "rail of [[mass]] 2", "circle of
// [[surface.patch]] 0".
std::string place(const std::string& path) {
  if (path.empty()) return "the top level";
  std::size_t dot = path.find('.');
  while (dot != std::string::npos && !is_index(part_at(path, dot + 1))) dot = path.find('.', dot + 1);
  if (dot == std::string::npos) return "[" + path + "]";
  const std::string index(part_at(path, dot + 1)), entry = "[[" + path.substr(0, dot) + "]] " + index;
  const std::size_t inner = dot + 1 + index.size();
  return inner == path.size() ? entry : path.substr(inner + 1) + " of " + entry;
}

// Words in quotes, or not, with commas between them and `last` before the last one.
template <class Words>
std::string listed(const Words& words, const char* quote, const char* last) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    text += fmt::format("{}{}{}{}", i == 0 ? "" : i + 1 < words.size() ? ", " : last, quote, words[i], quote);
  }
  return text;
}

std::string suggestion(std::string_view word, const std::vector<std::string>& known) {
  const std::string near = nearest(word, known);
  return near.empty() ? "" : "; did you mean " + near + "?";
}

}  // namespace

std::string nearest(std::string_view word, const std::vector<std::string>& known) {
  constexpr std::size_t kLongest = 64;  // the distance takes time in proportion to the product of the lengths
  std::string best;
  std::size_t best_distance = 0;
  if (word.size() > kLongest) return best;
  for (const std::string& candidate : known) {
    const std::size_t distance = edit_distance(word, candidate);
    if (3 * distance > std::max(word.size(), candidate.size())) continue;
    if (best.empty() || distance < best_distance) {
      best = candidate;
      best_distance = distance;
    }
  }
  return best;
}

std::string number_text(double value) {
  char buffer[32];
  const auto result = std::to_chars(buffer, buffer + sizeof buffer, value);
  return {buffer, result.ptr};
}

Range Range::any(std::string unit) {
  Range range;
  range.unit = std::move(unit);
  return range;
}

Range Range::positive(std::string unit) {
  Range range = any(std::move(unit));
  range.low = 0;
  range.low_excluded = true;
  return range;
}

Range Range::non_negative(std::string unit) {
  Range range = any(std::move(unit));
  range.low = 0;
  return range;
}

Range Range::between(double low, double high, std::string unit) {
  Range range = any(std::move(unit));
  range.low = low;
  range.high = high;
  return range;
}

bool Range::contains(double value) const {
  if (std::isinf(value)) return infinity_allowed && value > 0;
  return good_size(value) && (low_excluded ? value > low : value >= low) &&
         (high_excluded ? value < high : value <= high);
}

bool Range::good_size(double value) const {
  const bool too_small = low == 0 && low_excluded && value > 0 && value < kLeastSize;
  return std::abs(value) <= kMostSize && !too_small;
}

std::string Range::text_for(double value) const {
  if (!std::isfinite(value) || good_size(value)) return text();
  return text() + ", " + number_text(kLeastSize) + " to " + number_text(kMostSize) + " in size";
}

std::string Range::text() const {
  std::string text = infinity_allowed ? "number" : "finite number";
  const bool bounded_below = std::isfinite(low), bounded_above = std::isfinite(high);
  if (bounded_below && bounded_above && high_excluded) {  // a bracket at the end of a long number is overlooked
    text += (low_excluded ? " > " : " >= ") + number_text(low) + " and < " + number_text(high);
  } else if (bounded_below && bounded_above) {
    text += std::string(" in ") + (low_excluded ? "(" : "[") + number_text(low) + ", " + number_text(high) + "]";
  } else if (bounded_below) {
    text += (low_excluded ? " > " : " >= ") + number_text(low);
  } else if (bounded_above) {
    text += (high_excluded ? " < " : " <= ") + number_text(high);
  }
  if (!unit.empty()) text += ", in " + unit;
  if (infinity_allowed && !bounded_above) text += ", or inf";
  return text;
}

namespace {

// The kind of a value that has the wrong one. A value of --set that TOML cannot read is a string here.
std::string what_it_is(const Node& node) {
  const std::string kind = kKindNames[static_cast<std::size_t>(node.kind)];
  if (node.kind != NodeKind::kString) return kind;
  if (node.text.empty()) return "empty";
  double number = 0;
  const char* end = node.text.data() + node.text.size();
  const auto [parsed, error] = std::from_chars(node.text.data(), end, number);
  const bool quoted = node.written != node.text;
  if (quoted || parsed != end) return kind;
  if (error == std::errc::result_out_of_range) return "too large for a number";
  if (error != std::errc{}) return kind;
  const std::size_t sign = node.text[0] == '-' ? 1 : 0;
  const bool integer = node.text.find_first_not_of("0123456789", sign) == std::string::npos;
  return integer && node.text[sign] != '0' ? "too large for an integer"
                                           : "no number of TOML, which begins as 0.1 does, not .1 or 01";
}

}  // namespace

TableReader::TableReader(const Node* node, std::string path, ReadContext& context)
    : node_(node), source_(context.source_name), path_(std::move(path)), context_(&context) {
  if (node != nullptr && node->kind != NodeKind::kTable) {
    report_kind(*node, path_, "a table");
    node_ = nullptr;
    silent_ = true;
  }
  if (node_ != nullptr) {
    source_ = node_->source;
    line_ = node_->line;
  }
}

bool TableReader::is_table(std::string_view key) const {
  const Node* value = node_ == nullptr ? nullptr : node_->find(key);
  return value != nullptr && value->kind == NodeKind::kTable;
}

std::string TableReader::path_of(std::string_view key) const {
  return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

const Node* TableReader::node(std::string_view key) {
  if (std::find(known_.begin(), known_.end(), key) == known_.end()) {
    known_.emplace_back(key);
    note(key, "");
  }
  return node_ == nullptr ? nullptr : node_->find(key);
}

void TableReader::know(std::initializer_list<std::string_view> keys) {
  for (const std::string_view key : keys) static_cast<void>(node(key));
}

void TableReader::report(const Node& node, const std::string& path, const std::string& message) {
  context_->errors.push_back({node.source, node.line, path, node.written, message});
}

void TableReader::report_kind(const Node& node, const std::string& path, const std::string& allowed) {
  report(node, path, message("is {}; allowed: {}", what_it_is(node), allowed));
}

void TableReader::note(std::string_view key, const std::string& allowed, const std::string& fallback) {
  if (context_->keys == nullptr) return;
  std::string path, part;
  std::stringstream parts(path_of(key));
  while (std::getline(parts, part, '.')) {
    if (!path.empty()) path += '.';
    path += is_index(part) ? "N" : part;
  }
  context_->keys->push_back({path, allowed, fallback});
}

void TableReader::missing(std::string_view key, const std::string& allowed) {
  if (silent_) return;
  context_->errors.push_back(
      {source_, line_, path_of(key), "", "is missing from " + place(path_) + "; allowed: " + allowed});
}

void TableReader::report_at(std::string_view key, const std::string& message, std::vector<ScenarioError>& to) {
  const Node* at = node(key.substr(0, key.find('.')));
  for (std::size_t dot = key.find('.'); at != nullptr && dot != std::string_view::npos; dot = key.find('.', dot + 1)) {
    const std::string_view part = key.substr(dot + 1, key.find('.', dot + 1) - dot - 1);
    at = at->child(part);
  }
  if (at != nullptr) {
    to.push_back({at->source, at->line, path_of(key), at->written, message});
  } else if (!silent_) {
    to.push_back({source_, line_, path_of(key), "", message});
  }
}

std::optional<double> TableReader::checked_number(const Node& node, const std::string& path, const Range& range) {
  if (node.kind != NodeKind::kInteger && node.kind != NodeKind::kFloat) {
    report_kind(node, path, with_article(range.text()));
    return std::nullopt;
  }
  if (!range.contains(node.number)) {
    report(node, path, "is out of range; allowed: " + with_article(range.text_for(node.number)));
    return std::nullopt;
  }
  return node.number;
}

std::optional<double> TableReader::number(std::string_view key, const Range& range, std::optional<double> fallback) {
  note(key, range.text(), fallback ? number_text(*fallback) : "");
  const Node* value = node(key);
  if (value != nullptr) return checked_number(*value, path_of(key), range);
  if (!fallback) missing(key, with_article(range.text()));
  return fallback;
}

const Node* TableReader::value_of(std::string_view key, NodeKind kind, const std::string& allowed,
                                  const std::optional<std::string>& fallback) {
  note(key, allowed, fallback.value_or(""));
  const Node* value = node(key);
  if (value == nullptr) {
    if (!fallback) missing(key, allowed);
  } else if (value->kind != kind) {
    report_kind(*value, path_of(key), allowed);
    return nullptr;
  }
  return value;
}

std::optional<std::int64_t> TableReader::integer(std::string_view key, std::int64_t low, std::int64_t high,
                                                 std::int64_t fallback) {
  const std::string allowed = message("an integer in [{}, {}]", low, high);
  const Node* value = value_of(key, NodeKind::kInteger, allowed, std::to_string(fallback));
  if (value == nullptr) return has(key) ? std::nullopt : std::optional(fallback);
  if (value->integer >= low && value->integer <= high) return value->integer;
  report(*value, path_of(key), "is out of range; allowed: " + allowed);
  return std::nullopt;
}

std::optional<std::size_t> TableReader::choice(std::string_view key, std::span<const std::string_view> words,
                                               std::optional<std::size_t> fallback) {
  const std::string allowed = listed(words, "\"", " or ");
  const Node* value = value_of(key, NodeKind::kString, allowed,
                               fallback ? std::optional(message("\"{}\"", words[*fallback])) : std::nullopt);
  if (value == nullptr) return has(key) ? std::nullopt : fallback;
  const auto found = std::find(words.begin(), words.end(), value->text);
  if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
  report(
      *value, path_of(key),
      message("is none of the choices{}; allowed: {}", suggestion(value->text, {words.begin(), words.end()}), allowed));
  return std::nullopt;
}

std::optional<std::string> TableReader::text(std::string_view key) {
  const std::string allowed = "a string that is not empty";
  const Node* value = value_of(key, NodeKind::kString, allowed, std::nullopt);
  if (value == nullptr) return std::nullopt;
  if (!value->text.empty()) return value->text;
  report(*value, path_of(key), "is empty; allowed: " + allowed);
  return std::nullopt;
}

std::optional<bool> TableReader::boolean(std::string_view key, bool fallback) {
  const Node* value = value_of(key, NodeKind::kBoolean, "true or false", fallback ? "true" : "false");
  if (value == nullptr) return has(key) ? std::nullopt : std::optional(fallback);
  return value->boolean;
}

const Node* TableReader::array(std::string_view key, std::size_t least, std::size_t most, const std::string& allowed) {
  const Node* value = value_of(key, NodeKind::kArray, allowed, std::nullopt);
  if (value == nullptr || (value->items.size() >= least && value->items.size() <= most)) return value;
  report(*value, path_of(key), message("has {} elements; allowed: {}", value->items.size(), allowed));
  return nullptr;
}

std::optional<std::vector<double>> TableReader::checked_numbers(const Node& array, const std::string& path,
                                                                const Range& range) {
  std::vector<double> numbers;
  for (std::size_t i = 0; i < array.items.size(); ++i) {
    const auto number = checked_number(array.items[i], path + "." + std::to_string(i), range);
    if (number) numbers.push_back(*number);
  }
  return numbers.size() == array.items.size() ? std::optional(numbers) : std::nullopt;
}

std::optional<std::vector<double>> TableReader::numbers(std::string_view key, std::size_t size, const Range& range,
                                                        bool required) {
  const std::string allowed = message("an array of {} numbers, each a {}", size, range.text());
  if (!required && node(key) == nullptr) {
    note(key, allowed, "zeros");
    return std::vector<double>(size, 0.0);
  }
  const Node* value = array(key, size, size, allowed);
  return value == nullptr ? std::nullopt : checked_numbers(*value, path_of(key), range);
}

std::optional<std::vector<double>> TableReader::list(std::string_view key, std::size_t least, std::size_t most,
                                                     const Range& range) {
  const std::string count = least == most ? std::to_string(least) : message("{} to {}", least, most);
  const Node* value = array(key, least, most, message("an array of {} numbers, each a {}", count, range.text()));
  return value == nullptr ? std::nullopt : checked_numbers(*value, path_of(key), range);
}

template <int kSize>
std::optional<std::vector<Eigen::Matrix<double, kSize, 1>>> TableReader::vectors(std::string_view key,
                                                                                 std::size_t least, std::size_t most,
                                                                                 const Range& range) {
  const std::string count = least == most ? std::to_string(least) : message("{} to {}", least, most);
  const Node* value =
      array(key, least, most, message("an array of {} vectors of {} numbers, each a {}", count, kSize, range.text()));
  if (value == nullptr) return std::nullopt;
  std::vector<Eigen::Matrix<double, kSize, 1>> vectors;
  for (std::size_t i = 0; i < value->items.size(); ++i) {
    const Node& item = value->items[i];
    const std::string path = path_of(key) + "." + std::to_string(i);
    const std::string allowed = message("an array of {} numbers, each a {}", kSize, range.text());
    if (item.kind != NodeKind::kArray) {
      report_kind(item, path, allowed);
    } else if (item.items.size() != kSize) {
      report(item, path, message("has {} elements; allowed: {}", item.items.size(), allowed));
    } else if (const auto numbers = checked_numbers(item, path, range)) {
      vectors.emplace_back(numbers->data());
    }
  }
  return vectors.size() == value->items.size() ? std::optional(vectors) : std::nullopt;
}
template std::optional<std::vector<Eigen::Vector2d>> TableReader::vectors<2>(std::string_view, std::size_t, std::size_t,
                                                                             const Range&);
template std::optional<std::vector<Eigen::Vector3d>> TableReader::vectors<3>(std::string_view, std::size_t, std::size_t,
                                                                             const Range&);

TableReader TableReader::table(std::string_view key) {
  TableReader reader(node(key), path_of(key), *context_);
  reader.silent_ = reader.silent_ || silent_;
  if (!reader.present()) {
    reader.source_ = source_;
    reader.line_ = line_;
  }
  return reader;
}

std::vector<TableReader> TableReader::tables(std::string_view key, std::string_view allowed) {
  std::vector<TableReader> readers;
  const Node* value = value_of(key, NodeKind::kArray, std::string(allowed), "");
  if (value == nullptr) return readers;
  for (std::size_t i = 0; i < value->items.size(); ++i) {
    readers.emplace_back(&value->items[i], path_of(key) + "." + std::to_string(i), *context_);
  }
  return readers;
}

void TableReader::refuse_unknown_keys() {
  if (node_ == nullptr) return;
  for (const auto& [key, value] : node_->entries) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    report(
        value, path_of(key),
        message("unknown key{}; allowed in {}: {}", suggestion(key, known_), place(path_), listed(known_, "", ", ")));
  }
}

}  // namespace ballast::sim
