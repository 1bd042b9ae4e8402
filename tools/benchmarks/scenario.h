// Shared by the benchmarks: the paper's ball, and how often a benchmark runs its body.
#pragma once

#include <benchmark/benchmark.h>

#include <cstdlib>
#include <stdexcept>

#include "tools/program/program.h"

namespace ballast::benchmarks {

// BALLAST_BENCHMARK_CALLS=n in the environment makes every benchmark run its body exactly n times, so that instructions
// can be counted.
inline void as_many_calls_as_asked(benchmark::internal::Benchmark* b) {
  if (const char* calls = std::getenv("BALLAST_BENCHMARK_CALLS")) b->Iterations(std::strtoll(calls, nullptr, 10));
}

inline sim::Scenario paper_ball(const char* actuation) {
  program::ScenarioOptions options;
  options.scenario = "paper_ball";
  options.actuation = actuation;
  const auto loaded = program::load_scenario(options);
  if (!loaded) throw std::runtime_error("paper_ball does not load");
  return *loaded;
}

}  // namespace ballast::benchmarks
