// The paper's ball, for the benchmarks.
#pragma once

#include <stdexcept>

#include "tools/program/program.h"

namespace ballast::benchmarks {

inline sim::Scenario paper_ball(const char* actuation) {
  program::ScenarioOptions options;
  options.scenario = "paper_ball";
  options.actuation = actuation;
  const auto loaded = program::load_scenario(options);
  if (!loaded) throw std::runtime_error("paper_ball does not load");
  return *loaded;
}

}  // namespace ballast::benchmarks
