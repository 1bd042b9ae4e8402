// Numbers to bytes and back: little-endian, without padding, the same on every machine. No allocation.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace ballast::hal::target {

static_assert(std::endian::native == std::endian::little, "both ends of the link are little-endian");

// Messages are described once, as functions that hand every field to an archive: Writer, Reader. Both keep going after
// a failure without touching anything, and say so in ok().
//
// Real numbers travel as the 8 bytes of a double, whatever their type is: a double keeps its bits, NaN included. Those
// of the model, which are floats on a target with single precision, go through real(): what only looks at the fields
// must be able to tell them from those that are double everywhere.

class Writer {
 public:
  static constexpr bool kReads = false;
  explicit Writer(std::span<std::uint8_t> bytes) : bytes_(bytes) {}

  template <class T>
  void operator()(const T& value) {
    static_assert(!std::is_same_v<T, float>, "a number of the model goes through real()");
    if constexpr (std::is_floating_point_v<T>) {
      put(std::bit_cast<std::uint64_t>(value));
    } else if constexpr (std::is_same_v<T, bool>) {
      put(static_cast<std::uint8_t>(value ? 1 : 0));
    } else {
      put(value);
    }
  }
  template <class T>
  void real(const T& value) {
    (*this)(static_cast<double>(value));
  }
  template <class T>
  void bounded(const T& value, std::int64_t, std::int64_t) {
    (*this)(value);
  }
  template <class T>
  void sign(const T& value) {
    (*this)(value);
  }

  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  template <class T>
  void put(T value) {
    static_assert(std::is_integral_v<T> || std::is_enum_v<T>);
    if (bytes_.size() - size_ < sizeof value) return fail();
    std::memcpy(bytes_.data() + size_, &value, sizeof value);
    size_ += sizeof value;
  }
  // No room is left, so that nothing more is put.
  void fail() {
    ok_ = false;
    bytes_ = bytes_.first(size_);
  }

  std::span<std::uint8_t> bytes_;
  std::size_t size_ = 0;
  bool ok_ = true;
};

class Reader {
 public:
  static constexpr bool kReads = true;
  explicit Reader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <class T>
  void operator()(T& value) {
    static_assert(!std::is_enum_v<T>, "an enumeration has bounds");
    static_assert(!std::is_same_v<T, float>, "a number of the model goes through real()");
    if constexpr (std::is_floating_point_v<T>) {
      std::uint64_t bits = 0;
      if (take(bits)) value = std::bit_cast<T>(bits);
    } else if constexpr (std::is_same_v<T, bool>) {
      std::uint8_t flag = 0;
      if (!take(flag)) return;
      if (flag > 1) return fail();
      value = flag == 1;
    } else {
      T read = 0;
      if (take(read)) value = read;
    }
  }
  // Rounded where T has less.
  template <class T>
  void real(T& value) {
    std::uint64_t bits = 0;
    if (take(bits)) value = static_cast<T>(std::bit_cast<double>(bits));
  }
  // Outside low..high: not ok.
  template <class T>
  void bounded(T& value, std::int64_t low, std::int64_t high) {
    T read{};
    if (!take(read)) return;
    const auto number = static_cast<std::int64_t>(read);  // NOLINT(bugprone-signed-char-misuse): a number
    if (number < low || number > high) return fail();
    value = read;
  }

  // Anything but -1 and 1: not ok.
  template <class T>
  void sign(T& value) {
    T read{};
    if (!take(read)) return;
    if (read != 1 && read != -1) return fail();
    value = read;
  }

  // All was there and in range, and nothing is left over.
  [[nodiscard]] bool complete() const { return ok_ && at_ == bytes_.size(); }
  [[nodiscard]] bool ok() const { return ok_; }

 private:
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
  // Nothing is left, so that nothing more is taken.
  void fail() {
    ok_ = false;
    bytes_ = bytes_.first(at_);
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

// CRC-32 as in IEEE 802.3 (reflected, polynomial 0x04c11db7), continued from `crc`. Four bytes at a time ("slicing by
// four"): table[j] says what a byte does that has j more behind it.
namespace detail {
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

// One copy of it: it is asked for in many places.
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
