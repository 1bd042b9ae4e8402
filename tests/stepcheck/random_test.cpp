// The firmware's steps on random motions, held against the checker.
//   BALLAST_STEPCHECK_PROFILES=n   motions per shape, of which there are four (default 6000: some 10 s of CPU together;
//                                  500000, two million in all, take some 14 minutes)
//   BALLAST_SEED=n
//   BALLAST_STEPCHECK_OUT=file     error histogram as a table, for tools/plots
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iostream>

#include "tests/random_seed.h"
#include "tests/stepcheck/drives.h"

namespace ballast::stepcheck {
namespace {

std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

std::string describe(const Drive& d) {
  char text[200];
  std::snprintf(text, sizeof text, "timer %g Hz, period %g s, rate %g Hz, set-up %g s, %Lg microsteps per unit",
                d.timer_frequency_hz, d.control_period_s, d.max_step_rate_hz, d.direction_setup_s,
                d.motion.microsteps_per_unit);
  return text;
}

class RandomMotions : public ::testing::TestWithParam<Shape> {};

TEST_P(RandomMotions, EveryStepWhereItBelongs) {
  const std::uint64_t seed = ballast::test::random_seed(20240607);
  const std::uint64_t profiles = from_environment("BALLAST_STEPCHECK_PROFILES", 6000);
  RecordProperty("seed", std::to_string(seed));
  std::mt19937_64 random(seed + static_cast<std::uint64_t>(GetParam()));
  Statistics sum;
  std::int64_t ticks = 0;
  double worst = 0;  // as a part of the tolerance
  for (std::uint64_t k = 0; k < profiles; ++k) {
    const Drive drive = random_drive(GetParam(), random);
    Generator generator(drive);
    MotorCheck check(drive);
    const auto end = static_cast<std::int64_t>(generator.end_s() / drive.control_period_s) + 3;
    for (std::int64_t tick = 0; tick < end; ++tick) {
      const firmware::StepError error = generator.tick();
      ASSERT_EQ(error, firmware::StepError::kNone)
          << to_string(GetParam()) << ", seed " << seed << ", motion " << k << ", tick " << tick << ": "
          << generator.trouble().value << ", limit " << generator.trouble().limit << "; " << describe(drive);
      const auto violation =
          check.tick(tick, generator.bursts(), generator.command().steps[0], generator.command().position_steps[0]);
      ASSERT_FALSE(violation) << to_string(GetParam()) << ", seed " << seed << ", motion " << k << ": "
                              << violation->text() << "; " << describe(drive);
    }
    ticks += end;
    const Statistics& s = check.statistics();
    sum.checked_steps += s.checked_steps;
    sum.touches += s.touches;
    sum.max_error_us = std::max(sum.max_error_us, s.max_error_us);
    worst = std::max(worst, s.max_error_us / s.tolerance_us);
    for (std::size_t b = 0; b < kBins; ++b) sum.histogram[b] += s.histogram[b];
  }
  EXPECT_GT(sum.checked_steps, static_cast<std::int64_t>(profiles)) << "without steps nothing is proved";
  EXPECT_LE(worst, 1.003) << "the tolerance, and the crossings' own error of 1e-3 timer ticks";
  std::cout << to_string(GetParam()) << ", seed " << seed << ": " << profiles << " motions, " << ticks << " ticks, "
            << sum.checked_steps << " steps, " << sum.touches / 2 << " touches; worst error " << sum.max_error_us
            << " us, " << worst << " of the tolerance\n";
  if (const char* path = std::getenv("BALLAST_STEPCHECK_OUT")) {
    std::ofstream out(path, std::ios::app);
    out << to_string(GetParam()) << ',' << sum.checked_steps << ',' << sum.max_error_us << ',' << worst;
    for (const std::int64_t n : sum.histogram) out << ',' << n;
    out << '\n';
  }
}

std::string test_name(const ::testing::TestParamInfo<Shape>& shape_info) {
  switch (shape_info.param) {
    case Shape::kSCurves:
      return "SCurves";
    case Shape::kAtTheLimit:
      return "AtTheLimit";
    case Shape::kCreep:
      return "Creep";
    case Shape::kQuiver:
      return "Quiver";
  }
  return "";
}

// Motions at the limit that once needed more than the 32 bursts of a command: a burst late by
// its tolerance, and then the step rate, where nothing can be made up.
TEST(AtTheStepRate, AfterALateBurstATickStillNeedsFew) {
  std::mt19937_64 random(20240607 + static_cast<std::uint64_t>(Shape::kAtTheLimit));
  int looked_at = 0;
  for (int k = 0; k <= 39655; ++k) {
    const Drive drive = random_drive(Shape::kAtTheLimit, random);
    if (k != 6042 && k != 16701 && k != 19179 && k != 25593 && k != 39655) continue;
    ++looked_at;
    Generator generator(drive);
    MotorCheck check(drive);
    const auto end = static_cast<std::int64_t>(generator.end_s() / drive.control_period_s) + 3;
    for (std::int64_t tick = 0; tick < end; ++tick) {
      ASSERT_EQ(generator.tick(), firmware::StepError::kNone) << "motion " << k << ", tick " << tick;
      EXPECT_LE(generator.command().burst_count, 20) << "motion " << k << ", tick " << tick;
      const auto violation =
          check.tick(tick, generator.bursts(), generator.command().steps[0], generator.command().position_steps[0]);
      ASSERT_FALSE(violation) << "motion " << k << ": " << violation->text();
    }
  }
  EXPECT_EQ(looked_at, 5);
}

INSTANTIATE_TEST_SUITE_P(Shapes, RandomMotions, ::testing::ValuesIn(kShapes), test_name);

}  // namespace
}  // namespace ballast::stepcheck
