// Workers that work, crash, hang and are interrupted.
#include "tools/soak/workers.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <map>

namespace ballast::soak {
namespace {

SeedResult result_of(std::uint64_t seed) {
  SeedResult result;
  result.seed = seed;
  result.ticks = static_cast<std::int64_t>(seed * seed);
  return result;
}

std::map<std::uint64_t, SeedResult> run_all(const WorkerOptions& options,
                                            const std::function<SeedResult(std::uint64_t)>& run) {
  std::map<std::uint64_t, SeedResult> results;
  EXPECT_EQ(run_seeds(
                options, run, [&](const SeedResult& r) { EXPECT_TRUE(results.emplace(r.seed, r).second); }, [] {}),
            "");
  return results;
}

TEST(Workers, DoEverySeedOnceHoweverManyTheyAre) {
  for (const int jobs : {1, 2, 5}) {
    const auto results = run_all({.first = 7, .last = 106, .jobs = jobs}, result_of);
    ASSERT_EQ(results.size(), 100u);
    EXPECT_EQ(results.begin()->first, 7u);
    EXPECT_EQ(results.rbegin()->first, 106u);
    for (const auto& [seed, result] : results) EXPECT_EQ(result.ticks, static_cast<std::int64_t>(seed * seed));
  }
}

TEST(Workers, ACrashIsTheSeedsOwn) {
  const auto results = run_all({.first = 0, .last = 20, .jobs = 2}, [](std::uint64_t seed) {
    if (seed == 11) std::abort();
    if (seed == 12) _exit(5);
    return result_of(seed);
  });
  ASSERT_EQ(results.size(), 21u);
  for (const auto& [seed, result] : results) {
    EXPECT_EQ(result.broken, seed == 11 || seed == 12 ? static_cast<int>(Invariant::kEnded) : -1) << seed;
  }
  EXPECT_NE(std::string(results.at(11).broken_text).find("signal 6"), std::string::npos);
  EXPECT_NE(std::string(results.at(12).broken_text).find("status 5"), std::string::npos);
}

// The limit is far above what the other seeds need, and far below the sleeper's time.
TEST(Workers, NobodyWaitsForEver) {
  const auto results = run_all({.first = 0, .last = 5, .jobs = 2, .seed_limit_s = 5}, [](std::uint64_t seed) {
    if (seed == 3) sleep(3600);
    return result_of(seed);
  });
  ASSERT_EQ(results.size(), 6u);
  for (const auto& [seed, result] : results) {
    EXPECT_EQ(result.broken, seed == 3 ? static_cast<int>(Invariant::kPatient) : -1) << seed;
  }
}

// Killed at any moment, between its answer and the next seed too.
TEST(Workers, ASeedThatIsKilledIsToldOfOnce) {
  const auto results = run_all({.first = 0, .last = 199, .jobs = 3, .seed_limit_s = 1e-6}, result_of);
  EXPECT_EQ(results.size(), 200u);
}

TEST(Workers, AnInterruptEndsThem) {
  const volatile std::sig_atomic_t interrupted = SIGINT;
  WorkerOptions options{.first = 0, .last = 5, .jobs = 2};
  options.interrupted = &interrupted;
  const auto results = run_all(options, [](std::uint64_t seed) {
    sleep(3600);
    return result_of(seed);
  });
  EXPECT_TRUE(results.empty());
}

}  // namespace
}  // namespace ballast::soak
