// One seed: its scenario, its run in this process, and what came of it.
#pragma once

#include <cstdint>

#include "tools/soak/invariants.h"
#include "tools/soak/random_scenario.h"

namespace ballast::soak {

// Who was the first to notice, as far as messages and summary tell.
enum class Detector : std::int8_t { kNobody, kMonitor, kController, kRun, kPhysics };

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

  // For the failure table: of a run with one fault, whose twin without it completes untripped. Kind -1: of no use.
  std::int32_t fault_kind = -1;
  std::int32_t severity = 0;
  Detector detector = Detector::kNobody;
  std::int32_t sign = 0;            // the monitor's cause, or the controller's faults
  std::int64_t detected_after = 0;  // ticks, from the first that the fault could touch
};

SeedResult run_seed(std::uint64_t seed, bool with_twin);

}  // namespace ballast::soak
