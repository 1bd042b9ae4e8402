// Typed reading of one table of a scenario's tree. Every fault becomes a ScenarioError; reading goes on.
#pragma once

#include <Eigen/Core>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sim/scenario/tree.h"

namespace ballast::sim {

// What lies further out is no robot's, in whatever consistent units: products and quotients of such numbers lose the
// digits of all others, or overflow.
inline constexpr double kLeastSize = 1e-15;  // of numbers that must be > 0
inline constexpr double kMostSize = 1e15;

// The numbers allowed for a key: between low and high, and of a size that can be computed with. NaN never is.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_excluded = false;
  bool high_excluded = false;
  bool infinity_allowed = false;
  std::string unit;  // for people; empty: none

  static Range any(std::string unit = "");
  static Range positive(std::string unit = "");
  static Range non_negative(std::string unit = "");
  static Range between(double low, double high, std::string unit = "");  // both included

  [[nodiscard]] bool contains(double value) const;
  [[nodiscard]] bool good_size(double value) const;
  [[nodiscard]] std::string text() const;  // "finite number > 0, in m"
  // text(), and what sizes are good where that is what is wrong with a value.
  [[nodiscard]] std::string text_for(double value) const;
};

// Of `known`, the word nearest to what somebody wrote, with at most a third of the longer one wrong. Empty if none is.
std::string nearest(std::string_view word, const std::vector<std::string>& known);

// As people write it: the fewest digits that read back as the same number.
std::string number_text(double value);

struct ReadContext {
  std::string source_name;
  std::vector<ScenarioError>& errors;
};

class TableReader {
 public:
  // `node` may be nullptr (the table is missing: every required key is then reported) or something else than a table
  // (reported here, once, and its keys then no more). `path` is the dotted key of the table, empty for the top level.
  TableReader(const Node* node, std::string path, ReadContext& context);

  // Each reads one key: nothing if it is missing without a fallback or faulty, which is then reported.
  std::optional<double> number(std::string_view key, const Range& range, std::optional<double> fallback = std::nullopt);
  std::optional<std::int64_t> integer(std::string_view key, std::int64_t low, std::int64_t high, std::int64_t fallback);
  std::optional<std::string> word(std::string_view key, std::initializer_list<std::string_view> allowed,
                                  std::optional<std::string> fallback = std::nullopt);
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
  std::optional<std::vector<Eigen::Vector3d>> vectors(std::string_view key, std::size_t least, std::size_t most,
                                                      const Range& range);

  TableReader table(std::string_view key);
  // One reader per table of an array of tables; none if the key is missing or no such array, which is reported.
  std::vector<TableReader> tables(std::string_view key, std::string_view allowed);

  [[nodiscard]] bool present() const { return node_ != nullptr; }  // it is a table
  [[nodiscard]] bool has(std::string_view key) const { return node_ != nullptr && node_->find(key) != nullptr; }
  [[nodiscard]] const Node* node(std::string_view key);     // marks the key as known
  void know(std::initializer_list<std::string_view> keys);  // keys that belong here, though not read
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] bool is_table(std::string_view key) const;
  [[nodiscard]] std::string path_of(std::string_view key) const;

  // Reports a fault of a key, which may be deeper ("motion.1"); where the key is missing, with the table's line.
  void refuse(std::string_view key, const std::string& message);
  // Every key that was not asked for is unknown: suggests the nearest that was.
  void refuse_unknown_keys();

 private:
  std::optional<std::vector<double>> numbers(std::string_view key, std::size_t size, const Range& range, bool required);
  std::optional<double> checked_number(const Node& node, const std::string& path, const Range& range);
  void missing(std::string_view key, const std::string& allowed);
  void fault(const Node& node, const std::string& path, const std::string& message);

  const Node* node_ = nullptr;
  std::string source_;   // of what line_ speaks of
  int line_ = 0;         // of the table; of the table around it, if it is missing; 0: not known
  bool silent_ = false;  // something else than a table stands here
  std::string path_;
  ReadContext* context_;
  std::vector<std::string> known_;
};

}  // namespace ballast::sim
