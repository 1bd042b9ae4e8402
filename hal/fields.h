// Description of messages. Each is described once, as the chain of its fields, and every use is a visitor of that
// chain.
//
//   template <class V, Of<firmware::StepBurst> M>
//   auto fields(V& visitor, M& m, int motor_count = firmware::kMaxMasses) {
//     return visitor.field(LCM(motor), m.motor, Within(0, motor_count - 1))
//         .field(LCM(direction), m.direction, Sign())
//         ...
//   }
//
// A visitor takes the fields in the order of the chain. A rule (Within, first, When) may use members earlier in it: a
// reader has read them by then. The chain names every direct member of its struct, or visit() does not compile. A
// member that is a struct has a chain of its own, or visit() does not compile either.
//
// Visitors: target::Writer and target::Reader (the link to a microcontroller), the checksum in target/messages.cpp, the
// LCM conversions in lcm/messages.cpp, and random messages and comparisons in tests/conformance/random_message.h.
// Everything here also runs on the microcontroller and allocates nothing.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>

#include "firmware/model/types.h"

namespace ballast::hal {

// --- rules: the values of a field ---

struct Any {};     // every value; a floating-point number keeps its bits, NaN included
struct Real {};    // a number of the model: a float on a target with single precision, a double elsewhere
struct Sign {};    // -1 or 1
struct Tick {};    // a control tick; messages on a bus have none further than kFarthestTick from 0
struct Unsent {};  // not part of the message; readers leave it alone

// An integer or enumeration from low to high.
struct Within {
  std::int64_t low, high;
  template <class L, class H>
  constexpr Within(L from, H to) : low(static_cast<std::int64_t>(from)), high(static_cast<std::int64_t>(to)) {}
};

// The first `count` elements of an array. `rule` holds for each; if they are structs, their chains get it as a third
// argument.
template <class Rule>
struct First {
  int count;
  Rule rule;
};
template <class Rule = Any>
constexpr First<Rule> first(int count, Rule rule = {}) {
  return {count, rule};
}

// A struct that is there only if `present`; readers leave it alone otherwise.
struct When {
  bool present;
};

// The difference of two such ticks fits into 64 bits, with 1 added too.
inline constexpr std::int64_t kFarthestTick = (std::int64_t{1} << 62) - 1;

// --- names of fields on LCM ---

// `in(message)` is a member of an LCM message. The type of `message` is open, so a target can do without LCM.
template <class F>
struct LcmMember {
  const char* name;
  F in;
};
template <class F>
LcmMember(const char*, F) -> LcmMember<F>;  // Clang 14 deduces it only so
struct NotOnLcm {
  const char* name = "";
};

template <class M, class T>
concept Of = std::is_same_v<std::remove_const_t<M>, T>;

// --- visits ---

// Counts the fields of a chain; it is used for its type only.
template <int kFields>
struct Counter {
  static constexpr int kCount = kFields;
  template <class... A>
  Counter<kFields + 1> field(A&&...) const;
  template <class... T>
  Counter<kFields + sizeof...(T)> all(T&&...) const;
};

namespace detail {

struct Anything {
  template <class T>
  operator T() const;  // NOLINT(google-explicit-constructor): it stands for a member of any type
};
template <class T, class... Taken>
consteval int member_count() {
  if constexpr (requires { T{Taken{}..., Anything{}}; }) {
    return member_count<T, Taken..., Anything>();
  } else {
    return sizeof...(Taken);
  }
}

template <class T>
inline constexpr bool kIsArray = false;
template <class T, std::size_t N>
inline constexpr bool kIsArray<std::array<T, N>> = true;
template <class T>
inline constexpr bool kIsFirst = false;
template <class Rule>
inline constexpr bool kIsFirst<First<Rule>> = true;

}  // namespace detail

// Whether the chain of T names all its members. A type that is no aggregate answers for itself.
template <class T>
constexpr bool is_whole() {
  using Chain = decltype(fields(std::declval<Counter<0>&>(), std::declval<T&>()));
  if constexpr (std::is_aggregate_v<T>) return std::remove_cvref_t<Chain>::kCount == detail::member_count<T>();
  return true;
}

// Takes `visitor` along the chain of `m`. `context` holds further arguments of the chain.
template <class V, class M, class... Context>
constexpr void visit(V& visitor, M& m, const Context&... context) {
  static_assert(is_whole<std::remove_const_t<M>>(), "the chain of fields does not name every member of this struct");
  fields(visitor, m, context...);
}

// Base of all visitors: takes arrays, vectors and structs apart. A visitor supplies
//   leaf(name, value, rule)   one number, flag or enumeration; `rule` is Any, Real, Sign, Tick or Within
//   at(index)                 the index of the leaves that follow in their array; optional
template <class Self>
class Visitor {
 public:
  template <class Name, class T, class Rule = Any>
  requires requires(const Name& name) { name.name; }
  [[gnu::always_inline]] constexpr Self& field(const Name& name, T& member, const Rule& rule = {}) {
    using Member = std::remove_const_t<T>;
    if constexpr (std::is_same_v<Rule, Unsent>) {
    } else if constexpr (detail::kIsFirst<Rule>) {
      for (int i = 0; i < rule.count; ++i) element(name, member[static_cast<std::size_t>(i)], i, rule.rule);
    } else if constexpr (detail::kIsArray<Member>) {
      for (std::size_t i = 0; i < member.size(); ++i) element(name, member[i], static_cast<int>(i), rule);
    } else if constexpr (std::is_base_of_v<Eigen::QuaternionBase<Member>, Member>) {
      constexpr int kCoefficient[] = {3, 0, 1, 2};  // w, x, y, z; Eigen keeps w last
      for (int i = 0; i < 4; ++i) element(name, member.coeffs()[kCoefficient[i]], i, Real());
    } else if constexpr (std::is_base_of_v<Eigen::MatrixBase<Member>, Member>) {
      for (int i = 0; i < Member::SizeAtCompileTime; ++i) element(name, member[i], i, Real());
    } else if constexpr (std::is_same_v<Rule, When>) {
      if (rule.present) visit(self(), member);
    } else if constexpr (std::is_class_v<Member>) {
      visit(self(), member);
    } else {
      self().leaf(name, member, rule);
    }
    return self();
  }
  template <class T, class Rule = Any>
  [[gnu::always_inline]] constexpr Self& field(T& member, const Rule& rule = {}) {
    return field(NotOnLcm(), member, rule);
  }

  // Fields without name and rule.
  template <class T, class... More>
  [[gnu::always_inline]] constexpr Self& all(T& member, More&... more) {
    field(member);
    if constexpr (sizeof...(More) > 0) all(more...);
    return self();
  }

  constexpr void at(int) {}

 private:
  template <class Name, class T, class Rule>
  [[gnu::always_inline]] constexpr void element(const Name& name, T& member, int index, const Rule& rule) {
    self().at(index);
    if constexpr (!std::is_class_v<std::remove_const_t<T>>) {
      self().leaf(name, member, rule);
    } else if constexpr (std::is_same_v<Rule, Any>) {
      visit(self(), member);
    } else {
      visit(self(), member, rule);
    }
  }
  constexpr Self& self() { return static_cast<Self&>(*this); }
};

}  // namespace ballast::hal
