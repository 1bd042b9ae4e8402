// The seed of a random test. BALLAST_SEED, a decimal number, repeats a test that has failed; every seed is printed.
#pragma once

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <random>

namespace ballast::test {

// BALLAST_SEED if it is set; else `usual`; else any.
inline std::uint64_t random_seed(std::optional<std::uint64_t> usual = std::nullopt) {
  const char* given = std::getenv("BALLAST_SEED");
  std::uint64_t seed = 0;
  if (given != nullptr) {
    char* end = nullptr;
    seed = std::strtoull(given, &end, 10);
    if (*given < '0' || *given > '9' || *end != '\0') {
      std::fprintf(stderr, "BALLAST_SEED=%s: allowed: a decimal number\n", given);
      std::exit(1);
    }
  } else {
    seed = usual ? *usual : std::random_device{}();
  }
  std::printf("BALLAST_SEED=%llu\n", static_cast<unsigned long long>(seed));
  std::fflush(stdout);
  return seed;
}

}  // namespace ballast::test
