// Random messages and their comparison: visitors of the messages' own descriptions (hal/fields.h), so that every field
// takes part.
#pragma once

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "hal/messages.h"

namespace ballast::hal::test {

inline std::uint64_t bits(double value) { return std::bit_cast<std::uint64_t>(value); }

// Any 64 bits: every kind of number, infinities and NaNs. NaNs are quiet, as any move may quiet a signalling one.
inline double any_double(std::mt19937_64& random) {
  const std::uint64_t pattern = random();
  const double value = std::bit_cast<double>(pattern);
  return value == value ? value : std::bit_cast<double>(pattern | 0x8000000000000ull);
}

// Gives every field a random value that its rule allows.
class Randomize : public Visitor<Randomize> {
 public:
  explicit Randomize(std::mt19937_64& random) : random_(random) {}

  template <class Name, class T, class Rule>
  void leaf(const Name&, T& value, const Rule& rule) {
    if constexpr (std::is_same_v<Rule, Within>) {
      value = static_cast<T>(rule.low + static_cast<std::int64_t>(random_() % span(rule)));
    } else if constexpr (std::is_same_v<Rule, Sign>) {
      value = random_() % 2 == 0 ? 1 : -1;
    } else if constexpr (std::is_same_v<Rule, Tick>) {
      value = static_cast<std::int64_t>(random_()) >> 2;
    } else if constexpr (std::is_same_v<T, bool>) {
      value = random_() % 2 == 0;
    } else if constexpr (std::is_floating_point_v<T>) {
      value = static_cast<T>(any_double(random_));
    } else {
      value = static_cast<T>(random_());
    }
  }

 private:
  static std::uint64_t span(const Within& rule) { return static_cast<std::uint64_t>(rule.high - rule.low) + 1; }

  std::mt19937_64& random_;
};

template <class M>
void randomize(M& message, std::mt19937_64& random) {
  Randomize visitor(random);
  visit(visitor, message);
}
template <class M>
M random_message(std::mt19937_64& random) {
  M message;
  randomize(message, random);
  return message;
}

// The values of all fields as 64 bits each, with their names on LCM. `single_precision`: numbers of the model as a
// board with floats passes them on, rounded once; a NaN stays one without its bits.
class Values : public Visitor<Values> {
 public:
  struct Value {
    std::string name;
    std::uint64_t bits;
    bool operator==(const Value&) const = default;
    friend std::ostream& operator<<(std::ostream& out, const Value& value) {
      return out << value.name << ": 0x" << std::hex << value.bits << std::dec;
    }
  };
  explicit Values(bool single_precision) : single_precision_(single_precision) {}

  void at(int index) { index_ = index; }
  template <class Name, class T, class Rule>
  void leaf(const Name& name, const T& value, const Rule&) {
    std::string where = name.name;
    where += ' ' + std::to_string(index_);
    if constexpr (!std::is_floating_point_v<T>) {
      values.push_back({where, static_cast<std::uint64_t>(value)});
    } else if (single_precision_ && std::is_same_v<Rule, Real>) {
      const double rounded = static_cast<double>(static_cast<float>(value));
      values.push_back({where, bits(std::isnan(value) ? std::numeric_limits<double>::quiet_NaN() : rounded)});
    } else {
      values.push_back({where, bits(static_cast<double>(value))});
    }
  }

  std::vector<Value> values;

 private:
  bool single_precision_;
  int index_ = 0;
};

template <class M>
std::vector<Values::Value> values_of(const M& message, bool single_precision = false) {
  Values visitor(single_precision);
  visit(visitor, message);
  return std::move(visitor.values);
}
template <class M>
void expect_same(const M& a, const M& b, bool single_precision = false) {
  EXPECT_EQ(values_of(a, single_precision), values_of(b, single_precision));
}

}  // namespace ballast::hal::test
