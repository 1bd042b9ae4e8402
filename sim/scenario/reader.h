// Typed reading of one table of a scenario's tree. Each error is added to a list and reading continues, so that one run
// reports all of them.
#pragma once

#include <fmt/core.h>

#include <Eigen/Core>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "sim/scenario/tree.h"

namespace ballast::sim {

// Numbers of larger or smaller magnitude are refused: their products and quotients lose the digits of the others, or
// overflow.
inline constexpr double kLeastSize = 1e-15;  // for numbers that must be > 0
inline constexpr double kMostSize = 1e15;

// The numbers allowed for a key: between `low` and `high`, with a magnitude of at most kMostSize. NaN is never allowed.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_excluded = false;
  bool high_excluded = false;
  bool infinity_allowed = false;
  std::string unit;  // printed in messages; empty: dimensionless

  static Range any(std::string unit = "");
  static Range positive(std::string unit = "");
  static Range non_negative(std::string unit = "");
  static Range between(double low, double high, std::string unit = "");  // both included

  [[nodiscard]] bool contains(double value) const;
  [[nodiscard]] bool good_size(double value) const;
  [[nodiscard]] std::string text() const;  // "finite number > 0, in m"
  // text(), with the allowed magnitudes if those are what `value` breaks.
  [[nodiscard]] std::string text_for(double value) const;
};

// The entry of `known` nearest to `word`: at most a third of the longer one may differ. Empty if none is that near.
std::string nearest(std::string_view word, const std::vector<std::string>& known);

// The number with the fewest digits that read back as the same double.
std::string number_text(double value);

// The text of a message: fmt::format() with number_text() for doubles.
template <class T>
using Printed = std::conditional_t<std::is_same_v<T, double>, std::string, T>;
inline std::string printed(double value) { return number_text(value); }
template <class T>
T printed(T value) {
  return value;
}
template <class... Args>
std::string message(fmt::format_string<Printed<Args>...> format, Args... args) {
  return fmt::format(format, printed(args)...);
}

// A key that the reader asked for.
struct ReadKey {
  std::string key;       // dotted; the index of an array's entry is N
  std::string allowed;   // empty: the key was looked for, its value not read
  std::string fallback;  // the value of a missing key; empty: none, or one that the caller computes
};

struct ReadContext {
  std::string source_name;
  std::vector<ScenarioError>& errors;
  std::vector<ScenarioError>& warnings;
  std::vector<ReadKey>* keys = nullptr;  // if given, every key that is asked for is added
};

class TableReader {
 public:
  // `node` may be nullptr: the table is missing, and every required key is reported. A `node` that is no table is
  // reported here, and its keys are not reported again. `path` is the table's dotted key, empty for the top level.
  TableReader(const Node* node, std::string path, ReadContext& context);

  // Each of these reads one key. A value that is wrong, or missing without a fallback, is reported and gives nullopt.
  std::optional<double> number(std::string_view key, const Range& range, std::optional<double> fallback = std::nullopt);
  std::optional<std::int64_t> integer(std::string_view key, std::int64_t low, std::int64_t high, std::int64_t fallback);
  // The place among `words` of the one that is given.
  std::optional<std::size_t> choice(std::string_view key, std::span<const std::string_view> words,
                                    std::optional<std::size_t> fallback = std::nullopt);
  // The same as an enumerator of E, in whose order the words stand.
  template <class E>
  std::optional<E> choice(std::string_view key, std::initializer_list<std::string_view> words,
                          std::optional<E> fallback = std::nullopt) {
    const auto place = choice(key, std::span(words.begin(), words.size()),
                              fallback ? std::optional(static_cast<std::size_t>(*fallback)) : std::nullopt);
    return place ? std::optional(static_cast<E>(*place)) : std::nullopt;
  }
  std::optional<std::string> text(std::string_view key);  // required, not empty
  std::optional<bool> boolean(std::string_view key, bool fallback);
  template <int kSize>
  std::optional<Eigen::Matrix<double, kSize, 1>> vector(std::string_view key, const Range& range) {
    const auto values = numbers(key, kSize, range, true);
    return values ? std::optional(Eigen::Matrix<double, kSize, 1>(values->data())) : std::nullopt;
  }
  template <int kSize>
  std::optional<Eigen::Matrix<double, kSize, 1>> vector_or_zero(std::string_view key, const Range& range) {
    const auto values = numbers(key, kSize, range, false);
    return values ? std::optional(Eigen::Matrix<double, kSize, 1>(values->data())) : std::nullopt;
  }
  std::optional<std::vector<double>> list(std::string_view key, std::size_t least, std::size_t most,
                                          const Range& range);
  // kSize: 2 or 3.
  template <int kSize = 3>
  std::optional<std::vector<Eigen::Matrix<double, kSize, 1>>> vectors(std::string_view key, std::size_t least,
                                                                      std::size_t most, const Range& range);

  TableReader table(std::string_view key);
  // One reader per entry of an array of tables. A missing key gives none; a value that is no array is reported.
  std::vector<TableReader> tables(std::string_view key, std::string_view allowed);

  [[nodiscard]] bool present() const { return node_ != nullptr; }  // the table exists
  [[nodiscard]] bool has(std::string_view key) const { return node_ != nullptr && node_->find(key) != nullptr; }
  [[nodiscard]] const Node* node(std::string_view key);     // marks the key as known
  void know(std::initializer_list<std::string_view> keys);  // marks keys as known without reading them
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] bool is_table(std::string_view key) const;
  [[nodiscard]] std::string path_of(std::string_view key) const;

  // Reports an error of a key, which may be nested ("motion.1"). A missing key is reported with the table's line.
  void refuse(std::string_view key, const std::string& message) { report_at(key, message, context_->errors); }
  template <class... Args>
  void refuse(std::string_view key, fmt::format_string<Printed<Args>...> format, Args... args) {
    refuse(key, message(format, args...));
  }
  // The same for a value that is allowed and implausible.
  void warn(std::string_view key, const std::string& message) { report_at(key, message, context_->warnings); }
  template <class... Args>
  void warn(std::string_view key, fmt::format_string<Printed<Args>...> format, Args... args) {
    warn(key, message(format, args...));
  }
  // Reports every key that was not asked for, with the nearest known key.
  void refuse_unknown_keys();

 private:
  std::optional<std::vector<double>> numbers(std::string_view key, std::size_t size, const Range& range, bool required);
  std::optional<double> checked_number(const Node& node, const std::string& path, const Range& range);
  std::optional<std::vector<double>> checked_numbers(const Node& array, const std::string& path, const Range& range);
  // The value of a key, if it is of this kind. Another kind, or a missing key without a fallback, is reported.
  const Node* value_of(std::string_view key, NodeKind kind, const std::string& allowed,
                       const std::optional<std::string>& fallback);
  // The array of a key that must have `least` to `most` elements; anything else is reported and gives nullptr.
  const Node* array(std::string_view key, std::size_t least, std::size_t most, const std::string& allowed);
  void missing(std::string_view key, const std::string& allowed);
  void report(const Node& node, const std::string& path, const std::string& message);
  void report_kind(const Node& node, const std::string& path, const std::string& allowed);
  void note(std::string_view key, const std::string& allowed, const std::string& fallback = "");
  void report_at(std::string_view key, const std::string& message, std::vector<ScenarioError>& to);

  const Node* node_ = nullptr;
  std::string source_;   // the file or option of `line_`
  int line_ = 0;         // line of the table, or of the enclosing one if the table is missing; 0: unknown
  bool silent_ = false;  // the value here is no table, which has been reported
  std::string path_;
  ReadContext* context_;
  std::vector<std::string> known_;
};

}  // namespace ballast::sim
