// Changes one thing in an input that is a sequence of parts: messages, frames or events.
#pragma once

#include <algorithm>

#include "tests/fuzz/fuzz_target.h"

namespace ballast::fuzz {

// Where a part lies in the input, and its payload in it.
struct Part {
  std::size_t at, size;
  std::size_t payload_at, payload_size;
};

// Mostly flips one bit of one payload; else drops, doubles or swaps whole parts.
inline Bytes change_one_part(Bytes bytes, const std::vector<Part>& parts, std::mt19937_64& random) {
  if (parts.empty()) return bytes;
  const Part& part = parts[below(parts.size(), random)];
  const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(part.at);
  const auto end = begin + static_cast<std::ptrdiff_t>(part.size);
  const std::size_t choice = below(16, random);
  if (choice == 0) {
    bytes.erase(begin, end);
  } else if (choice == 1) {
    const Bytes copy(begin, end);
    const Part& before = parts[below(parts.size(), random)];
    bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(before.at), copy.begin(), copy.end());
  } else if (choice == 2) {
    std::rotate(begin, end, bytes.end());  // it comes last
  } else if (part.payload_size > 0) {
    bytes[part.payload_at + below(part.payload_size, random)] ^= static_cast<std::uint8_t>(1 << below(8, random));
  }
  return bytes;
}

}  // namespace ballast::fuzz
