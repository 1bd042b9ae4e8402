// A fuzz target: one function, given any bytes. It is linked to libfuzzer.cpp or to corpus_test.cpp.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

namespace ballast::fuzz {

// Hands the bytes to a decoder, and holds to its word whatever it lets through. True: it let something through.
bool take(std::span<const std::uint8_t> input);

// A finding, unless `holds`.
inline void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "does not hold: %s\n", what);
  std::abort();
}

}  // namespace ballast::fuzz
