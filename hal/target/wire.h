// Bytes of the link: visitors that write and read fields (hal/fields.h), little-endian and without padding, and the
// checksum of frames. No allocation.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "hal/fields.h"

namespace ballast::hal::target {

static_assert(std::endian::native == std::endian::little, "both ends of the link are little-endian");

// Every floating-point number travels as the 8 bytes of a double. A number of the model (Real) is converted where the
// target has floats; every other one keeps its bits. After a failure Writer and Reader touch nothing and ok() is false.

class Writer : public Visitor<Writer> {
 public:
  explicit Writer(std::span<std::uint8_t> bytes) : bytes_(bytes) {}

  template <class T>
  void operator()(const T& value) {
    static_assert(!std::is_same_v<T, float>, "a number of the model has the rule Real");
    if constexpr (std::is_same_v<T, double>) {
      put(std::bit_cast<std::uint64_t>(value));
    } else if constexpr (std::is_same_v<T, bool>) {
      put(static_cast<std::uint8_t>(value ? 1 : 0));
    } else {
      put(value);
    }
  }
  template <class Name, class T, class Rule>
  [[gnu::always_inline]] void leaf(const Name&, const T& value, const Rule&) {
    if constexpr (std::is_same_v<Rule, Real>) {
      (*this)(static_cast<double>(value));
    } else {
      (*this)(value);
    }
  }

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  template <class T>
  void put(T value) {
    static_assert(std::is_integral_v<T> || std::is_enum_v<T>);
    if (bytes_.size() - size_ < sizeof value) {
      ok_ = false;
      bytes_ = bytes_.first(size_);  // nothing more fits
      return;
    }
    std::memcpy(bytes_.data() + size_, &value, sizeof value);
    size_ += sizeof value;
  }

  std::span<std::uint8_t> bytes_;
  std::size_t size_ = 0;
  bool ok_ = true;
};

class Reader : public Visitor<Reader> {
 public:
  explicit Reader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <class T>
  void operator()(T& value) {
    static_assert(!std::is_enum_v<T>, "an enumeration has the rule Within");
    static_assert(!std::is_same_v<T, float>, "a number of the model has the rule Real");
    if constexpr (std::is_same_v<T, bool>) {
      std::uint8_t flag = 0;
      if (!take(flag)) return;
      if (flag > 1) return fail();
      value = flag == 1;
    } else {
      take(value);
    }
  }
  // Tick has no bounds here: the board goes by the frame's own tick, and the firmware judges the others.
  template <class Name, class T, class Rule>
  [[gnu::always_inline]] void leaf(const Name&, T& value, const Rule& rule) {
    if constexpr (std::is_same_v<Rule, Real>) {
      double wide = 0;
      if (take(wide)) value = static_cast<T>(wide);
    } else if constexpr (std::is_same_v<Rule, Within>) {
      bounded(value, rule.low, rule.high);
    } else if constexpr (std::is_same_v<Rule, Sign>) {
      T sign{};
      if (!take(sign)) return;
      if (sign != 1 && sign != -1) return fail();
      value = sign;
    } else {
      (*this)(value);
    }
  }

  // Everything was there and in range, and nothing is left over.
  [[nodiscard]] bool complete() const { return ok_ && at_ == bytes_.size(); }
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  template <class T>
  void bounded(T& value, std::int64_t low, std::int64_t high) {
    T read{};
    if (!take(read)) return;
    const auto number = static_cast<std::int64_t>(read);  // NOLINT(bugprone-signed-char-misuse): a number
    if (number < low || number > high) return fail();
    value = read;
  }
  template <class T>
  bool take(T& value) {
    if (bytes_.size() - at_ < sizeof value) {
      fail();
      return false;
    }
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return true;
  }
  void fail() {
    ok_ = false;
    bytes_ = bytes_.first(at_);  // nothing more is taken
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

namespace detail {
// kCrcTables[j][b] is what byte b does to the checksum with j more bytes behind it ("slicing by four").
constexpr auto kCrcTables = [] {
  std::array<std::array<std::uint32_t, 256>, 4> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t c = i;
    for (int k = 0; k < 8; ++k) c = (c & 1) != 0 ? 0xedb88320u ^ (c >> 1) : c >> 1;
    table[0][i] = c;
  }
  for (std::size_t j = 1; j < 4; ++j) {
    for (std::uint32_t i = 0; i < 256; ++i) table[j][i] = table[0][table[j - 1][i] & 0xff] ^ (table[j - 1][i] >> 8);
  }
  return table;
}();
}  // namespace detail

// CRC-32 of IEEE 802.3 (reflected, polynomial 0x04c11db7), continued from `crc`. Not inlined: callers share one copy.
[[gnu::noinline]] inline std::uint32_t crc32(std::span<const std::uint8_t> bytes, std::uint32_t crc = 0) {
  const auto& table = detail::kCrcTables;
  crc = ~crc;
#pragma GCC unroll 4
  for (; bytes.size() >= 4; bytes = bytes.subspan(4)) {
    std::uint32_t four = 0;
    std::memcpy(&four, bytes.data(), 4);
    crc ^= four;
    crc = table[3][crc & 0xff] ^ table[2][crc >> 8 & 0xff] ^ table[1][crc >> 16 & 0xff] ^ table[0][crc >> 24];
  }
  for (const std::uint8_t byte : bytes) crc = table[0][(crc ^ byte) & 0xff] ^ (crc >> 8);
  return ~crc;
}

}  // namespace ballast::hal::target
