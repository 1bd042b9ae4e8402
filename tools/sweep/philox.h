// Philox4x32-10, a counter-based random number generator: the numbers of a counter need no state, so that any process
// computes those of any run. Source: Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC'11.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace ballast::sweep {

using PhiloxBlock = std::array<std::uint32_t, 4>;
using PhiloxKey = std::array<std::uint32_t, 2>;

constexpr PhiloxBlock philox(PhiloxBlock counter, PhiloxKey key) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = std::uint64_t{0xD2511F53} * counter[0], b = std::uint64_t{0xCD9E8D57} * counter[2];
    counter = {static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(b),
               static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(a)};
    key = {key[0] + 0x9E3779B9, key[1] + 0xBB67AE85};
  }
  return counter;
}

// FNV-1a, 64 bits.
constexpr std::uint64_t hash_of(std::string_view text, std::uint64_t hash = 14695981039346656037u) {
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return hash;
}

// 64 random bits of a run, from the sweep's seed, a name and the run's number alone. A name has a stream of its own, so
// that varying one more key changes no other value.
constexpr std::uint64_t random_bits(std::uint64_t seed, std::string_view name, std::uint64_t number) {
  const auto low = [](std::uint64_t bits) { return static_cast<std::uint32_t>(bits); };
  const std::uint64_t stream = hash_of(name);
  const PhiloxBlock block =
      philox({low(number), low(number >> 32), low(stream), low(stream >> 32)}, {low(seed), low(seed >> 32)});
  return std::uint64_t{block[1]} << 32 | block[0];
}

// Uniform in (0, 1), neither end included: 52 bits, each the middle of its interval.
constexpr double unit_interval(std::uint64_t bits) { return (static_cast<double>(bits >> 12) + 0.5) * 0x1p-52; }

}  // namespace ballast::sweep
