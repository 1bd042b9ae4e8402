// Totals of a soak, and the file that adds up those of several ranges of seeds.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tools/soak/seed_run.h"

namespace ballast {

struct SoakTotals {
  std::uint64_t seeds = 0, broken = 0, faults = 0, faulty = 0, violated = 0;
  std::int64_t simulated_us = 0, ticks = 0, refused = 0;
  std::array<std::uint64_t, soak::kOutcomeCount> outcomes{};
  double wall_s = 0;

  void add(const soak::SeedResult& result);
  void add(const SoakTotals& other);
  [[nodiscard]] std::string text() const;
};

struct SeedRange {
  std::uint64_t first = 0, last = 0;  // both included
};

// Ranges that one build has run, none twice.
struct SoakFile {
  std::string build;
  std::vector<SeedRange> ranges;
  SoakTotals totals;
};

// Reads `path` into `out`; a file that does not exist has no ranges. Empty, or why `range` cannot be added by this
// build: a file that is no such one, another build's, or a range of which a part is in it.
[[nodiscard]] std::string read_soak_file(const std::filesystem::path& path, const std::string& build,
                                         const SeedRange& range, SoakFile& out);

// Written whole or not at all. False: not written.
[[nodiscard]] bool write_soak_file(const std::filesystem::path& path, const SoakFile& file);

}  // namespace ballast
