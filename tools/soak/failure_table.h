// The failure table: for each kind and severity of fault who detected it, after how many ticks, and the outcome. It is
// made from runs of calm robots with one fault each that complete without a trip if the fault is left out.
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
  // Results may come in any order. Those without a use for the table are ignored.
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
