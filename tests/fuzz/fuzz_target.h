// A fuzz target: one function, given any bytes. It is linked to libfuzzer.cpp or to corpus_test.cpp.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <span>
#include <vector>

namespace ballast::fuzz {

using Bytes = std::vector<std::uint8_t>;

// Hands the bytes to a decoder and checks what the decoder promises of everything it lets through. True: it let
// something through.
bool take(std::span<const std::uint8_t> input);

// Changes one thing in an input so that its form stays whole: a number, a line, a field of a message, a frame. Of an
// input that take() lets through, most changed ones are let through too, so that what lies behind the parser is
// reached.
Bytes change_one_thing(Bytes input, std::mt19937_64& random);

// 0 .. n - 1; 0 if n is 0.
inline std::size_t below(std::size_t n, std::mt19937_64& random) {
  return n == 0 ? 0 : static_cast<std::size_t>(random() % n);
}

// A finding, unless `holds`.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what);
  std::abort();
}

}  // namespace ballast::fuzz
