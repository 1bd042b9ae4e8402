// Properties of every accepted scenario.
#pragma once

#include <algorithm>
#include <cmath>

#include "sim/scenario/scenario.h"
#include "tests/fuzz/fuzz_target.h"

namespace ballast::fuzz {

// Refused: with reasons, one line each, that a terminal can show. Accepted: as a scenario that its own text gives
// again. True: accepted.
inline bool check(const sim::ScenarioResult& result) {
  for (const sim::ScenarioError& error : result.errors) {
    require(!error.message.empty(), "a refusal has a reason");
    require(error.line >= 0, "lines are counted from 1, 0: not known");
    const std::string text = to_string(error);
    require(std::none_of(text.begin(), text.end(), [](char c) { return (c >= 0 && c < ' ') || c == 0x7f; }),
            "a refusal is one line without control characters");
  }
  if (!result.ok()) return false;
  const sim::Scenario& s = result.scenario;
  require(s.id != 0 && s.duration_s > 0 && std::isfinite(s.duration_s), "an accepted scenario is one");
  require(s.masses.size() <= 8, "no more masses than there may be");
  const sim::ScenarioResult again = sim::parse_scenario(s.toml, "again.toml");
  if (!again.ok()) std::fprintf(stderr, "%s\n%s\n", to_string(again.errors[0]).c_str(), s.toml.c_str());
  require(again.ok(), "an accepted scenario's own text is accepted");
  require(again.scenario.id == s.id, "and is the same scenario");
  return true;
}

}  // namespace ballast::fuzz
