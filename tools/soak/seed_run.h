// One seed: its scenario, its run in this process, and what came of it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "tools/soak/invariants.h"
#include "tools/soak/random_scenario.h"

namespace ballast::soak {

// How the run ended.
enum class Outcome : std::int8_t {
  kCompleted,    // to the scenario's end, no trip
  kStopped,      // tripped, and the masses came to rest
  kStillMoving,  // tripped; stopped as commanded, and said that the masses still move
  kCutShort,     // tripped; the scenario's time was over before they rested
  kSlipped,
  kDetached,
  kInconsistent,
  kGivenUp,  // could not go on; says why, and the log holds what happened
};
inline constexpr int kOutcomeCount = 8;
const char* to_string(Outcome outcome);

// Goes through a pipe as it is.
struct SeedResult {
  std::uint64_t seed = 0;
  std::int64_t ticks = 0;
  std::int64_t simulated_us = 0;
  std::int32_t refused = 0;  // scenarios drawn before one was accepted
  std::int32_t faults = 0;
  Outcome outcome = Outcome::kCompleted;
  bool violated = false;  // the true ball left the envelope

  // Of the first invariant that broke; -1: none did.
  std::int32_t broken = -1;
  std::int64_t broken_tick = 0;
  char broken_text[300] = {};

  // For the failure table, if asked for; kind -1: it is of no use there.
  std::int32_t fault_kind = -1;
  std::int32_t severity = 0;
  bool detected = false;
  std::int64_t detected_after = 0;  // ticks, from the first that the fault could touch
  char detected_by[40] = {};        // who was the first to notice, and as what
};

// Sets a text field of a SeedResult to as much of `text` as fits.
template <std::size_t N>
void set_text(char (&field)[N], std::string_view text) {
  field[text.copy(field, N - 1)] = '\0';
}

// A random scenario with its random faults.
SeedResult run_seed(std::uint64_t seed);

// For the failure table: a calm robot that suffers one fault. Kinds and severities take turns, seed by seed.
SeedResult run_table_seed(std::uint64_t seed);
RandomScenario table_scenario(std::uint64_t seed);

}  // namespace ballast::soak
