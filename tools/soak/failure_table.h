// The failure table: fault x severity -> detected by whom, after how many ticks, outcome. From runs of calm robots
// that suffer one fault each, and whose twins without it come to their end untripped.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>

#include "tools/soak/seed_run.h"

namespace ballast::soak {

class FailureTable {
 public:
  // In any order. Runs that are of no use for it change nothing.
  void add(const SeedResult& result);
  [[nodiscard]] std::string markdown() const;

 private:
  struct Row {
    std::int64_t runs = 0, detected = 0, least_ticks = 0, most_ticks = 0, violated = 0;
    std::map<std::string, std::int64_t> detected_by;
    std::array<std::int64_t, kOutcomeCount> outcomes{};
  };
  std::map<std::pair<std::int32_t, std::int32_t>, Row> rows_;  // by kind and severity
};

}  // namespace ballast::soak
