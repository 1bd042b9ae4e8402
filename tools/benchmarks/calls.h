// BALLAST_BENCHMARK_CALLS=n in the environment makes every benchmark run its body exactly n times, so that a program
// that counts instructions counts the same ones every time (tools/benchmarks/instructions).
#pragma once

#include <benchmark/benchmark.h>

#include <cstdlib>

namespace ballast::benchmarks {

inline void as_many_calls_as_asked(benchmark::internal::Benchmark* b) {
  if (const char* calls = std::getenv("BALLAST_BENCHMARK_CALLS")) b->Iterations(std::strtoll(calls, nullptr, 10));
}

}  // namespace ballast::benchmarks
