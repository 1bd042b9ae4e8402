// The run of one seed: its scenario, the run in this process, and the result.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "tools/soak/invariants.h"
#include "tools/soak/random_scenario.h"

namespace ballast::soak {

// How the run ended.
enum class Outcome : std::int8_t {
  kCompleted,    // reached the scenario's end without a trip
  kStopped,      // tripped, and the masses came to rest
  kStillMoving,  // tripped and stopped as commanded; the run reports that the masses still move
  kCutShort,     // tripped; the scenario ended before the masses rested
  kSlipped,
  kDetached,
  kInconsistent,
  kGivenUp,  // could not go on; the run reports why, and the log is complete up to there
};
inline constexpr int kOutcomeCount = 8;
const char* to_string(Outcome outcome);

// Sent through a pipe byte by byte.
struct SeedResult {
  std::uint64_t seed = 0;
  std::int64_t ticks = 0;
  std::int64_t simulated_us = 0;
  std::int32_t refused = 0;  // scenarios drawn before one was accepted
  std::int32_t faults = 0;
  Outcome outcome = Outcome::kCompleted;
  bool violated = false;  // the true ball left the envelope

  // The first invariant that broke; -1: none.
  std::int32_t broken = -1;
  std::int64_t broken_tick = 0;
  char broken_text[300] = {};

  // For the failure table; kind -1: the result is not used there.
  std::int32_t fault_kind = -1;
  std::int32_t severity = 0;
  bool detected = false;
  std::int64_t detected_after = 0;  // in ticks, from the first that the fault can affect
  char detected_by[40] = {};        // who noticed first, and the cause
};

// Sets a text field of a SeedResult to as much of `text` as fits.
template <std::size_t N>
void set_text(char (&field)[N], std::string_view text) {
  field[text.copy(field, N - 1)] = '\0';
}

// The outcome of a seed's run.
struct SeedRun {
  sil::RunResult result;
  std::vector<Broken> broken;
  std::uint64_t log_hash = 0;
  bool violated = false;
};
using Runner = std::function<SeedRun(const RandomScenario&)>;

// In this process, judged by the invariants.
SeedRun run_scenario(const RandomScenario& random);

// A random scenario with its random faults and its operator. One seed in 32 is run twice.
SeedResult run_seed(std::uint64_t seed, const Runner& run);
SeedResult run_seed(std::uint64_t seed);

// For the failure table: a calm robot with one fault. Kinds and severities alternate with the seed.
SeedResult run_table_seed(std::uint64_t seed);
RandomScenario table_scenario(std::uint64_t seed);

}  // namespace ballast::soak
