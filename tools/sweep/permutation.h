// A random permutation of 0 ... count - 1 whose entries are computed one by one, without a table.
#pragma once

#include <bit>
#include <cstdint>

#include "tools/sweep/philox.h"

namespace ballast::sweep {

// Where the permutation chosen by `key` takes `place` < count <= 2^53. A Feistel network with Philox as its round
// function permutes the smallest square of a power of two that holds `count`; places beyond `count` are permuted on
// until they are below it ("cycle walking"), which takes fewer than 4 turns on average (16 where count is below 16).
// Source: J. Black, P. Rogaway, "Ciphers with arbitrary finite domains", CT-RSA 2002, section 4.
constexpr std::uint64_t permuted(std::uint64_t place, std::uint64_t count, std::uint64_t key) {
  constexpr std::uint32_t kRounds = 6;
  const int half = count <= 16 ? 2 : (static_cast<int>(std::bit_width(count - 1)) + 1) / 2;
  const std::uint64_t mask = (std::uint64_t{1} << half) - 1;
  const PhiloxKey words{static_cast<std::uint32_t>(key), static_cast<std::uint32_t>(key >> 32)};
  do {
    std::uint64_t left = place >> half, right = place & mask;
    for (std::uint32_t round = 0; round < kRounds; ++round) {
      const std::uint64_t mixed = left ^ (philox({static_cast<std::uint32_t>(right), round, 0, 0}, words)[0] & mask);
      left = right;
      right = mixed;
    }
    place = left << half | right;
  } while (place >= count);
  return place;
}

}  // namespace ballast::sweep
