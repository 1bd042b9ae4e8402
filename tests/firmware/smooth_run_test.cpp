// Bursts of a stretch without reversals: too few to be within the tolerance, but within all other rules.
#include "firmware/motion/smooth_run.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace ballast::firmware {
namespace {

// A control tick of 1 ms that begins between two levels, at 2 to 60 steps in it.
struct Case {
  SmoothRun run;
  PulseRules rules;
  Wide timer_frequency_hz;
};

Case random_case(std::mt19937& random) {
  std::uniform_real_distribution<Wide> u(0, 1);
  constexpr Wide kPeriod_s = 1e-3, kRate_hz = 61e3;
  const Wide timer_hz = u(random) < 0.5 ? 1e6 : 1e7;
  SmoothRun run;
  run.direction = u(random) < 0.5 ? 1 : -1;
  run.end_s = kPeriod_s;
  for (;;) {
    const Wide v0 = 2000 + 58000 * u(random), v1 = 2000 + 58000 * u(random);
    // The acceleration keeps its sign: twice the mean at one end and 0 at the other at most.
    const Wide mean = (v1 - v0) / kPeriod_s, tilt = 2 * u(random) - 1;
    run.cubic = {-u(random) * run.direction, v0 * run.direction, mean * (1 - tilt) * run.direction,
                 2 * mean * tilt / kPeriod_s * run.direction};
    run.first_level = 0;
    run.steps = static_cast<int>(run.direction * run.cubic.at(kPeriod_s)) + 1;
    if (run.direction * run.cubic.at(kPeriod_s) > 0 && run.steps <= kMaxStepsPerTick) break;
  }
  return {run, PulseRules{{timer_hz, kPeriod_s, 2e-6, false, true}, kRate_hz}, timer_hz};
}

TEST(CoarseSmoothBursts, KeepEveryRuleButTheTolerance) {
  const unsigned seed = 77;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<Wide> u(0, 1);
  int made = 0, refused = 0;
  for (int k = 0; k < 50000; ++k) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", case " << k);
    Case c = random_case(random);
    const int room = 1 + static_cast<int>(u(random) * 8);
    // In half of the cases pulses of the tick before push the first one back, by up to 20 distances.
    if (u(random) < 0.5) c.run.earliest = static_cast<std::int32_t>(u(random) * 20 * c.rules.spacing_ticks);
    std::array<StepBurst, kMaxBursts> bursts{};
    const int count = coarse_smooth_bursts(c.run, c.rules, c.timer_frequency_hz, bursts.data(), room);
    if (count == kNotProved) {
      // Only where so many pulses do not fit between the one before and the last one's crossing.
      const int last = c.run.steps - 1;
      const Wide crossing =
          c.timer_frequency_hz * crossing_time(c.run.cubic, c.run.direction * last, 0, c.run.end_s, 1e-12);
      ASSERT_GT(c.run.earliest + last * c.rules.gap, crossing - 1);
      ++refused;
      continue;
    }
    ++made;
    ASSERT_EQ(count, std::min(room, c.run.steps));
    int pulses = 0;
    std::int64_t earliest = c.run.earliest;
    for (int b = 0; b < count; ++b) {
      const StepBurst& burst = bursts[static_cast<std::size_t>(b)];
      ASSERT_EQ(burst.direction, c.run.direction);
      ASSERT_GE(burst.count, 1);
      ASSERT_LE(burst.count, (c.run.steps + room - 1) / room) << "of equal numbers";
      for (std::int64_t j = 0; j < burst.count; ++j, ++pulses) {
        const std::int64_t at = burst.first_ticks + j * burst.interval_ticks + burst.add_ticks * (j * (j - 1) / 2);
        ASSERT_GE(at, earliest);
        ASSERT_LE(at, c.rules.last_tick);
        earliest = at + c.rules.gap;
      }
    }
    ASSERT_EQ(pulses, c.run.steps);
  }
  EXPECT_GT(made, 40000);
  EXPECT_GT(refused, 10);
}

// An interval rounded to whole timer ticks strays by m / 4 over m of them, if it is off by as much at both ends; and a
// straight line from a curve by m^2 / 8 of its second derivative, t'' = -a / v^3.
TEST(CoarseSmoothBursts, StayNearTheCrossings) {
  const unsigned seed = 78;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  for (int k = 0; k < 20000; ++k) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", case " << k);
    Case c = random_case(random);
    // The tick's last pulse is never later than its crossing's tolerance: what has to come before is clamped only where
    // pulses are as close as they may be.
    if (std::max(std::fabs(c.run.cubic.velocity), std::fabs(c.run.cubic.velocity_at(c.run.end_s))) > 50e3) continue;
    std::array<StepBurst, kMaxBursts> bursts{};
    const int count = coarse_smooth_bursts(c.run, c.rules, c.timer_frequency_hz, bursts.data(), 4);
    ASSERT_GT(count, 0);
    const StepCubic& x = c.run.cubic;
    const Wide slowest = std::min(std::fabs(x.velocity), std::fabs(x.velocity_at(c.run.end_s)));
    const Wide a = std::max(std::fabs(x.acceleration), std::fabs(x.acceleration_at(c.run.end_s)));
    const Wide second = a / (slowest * slowest * slowest) * c.timer_frequency_hz;
    int n = 0;
    for (int b = 0; b < count; ++b) {
      const StepBurst& burst = bursts[static_cast<std::size_t>(b)];
      const Wide m = burst.count - 1;
      // And a pulse's own rounding; as much again where the tick's last pulse may not come after its crossing.
      const Wide allowed = m / 2 + 2 + m * m / 8 * second;
      for (std::int64_t j = 0; j < burst.count; ++j) {
        const Wide w = crossing_time(x, static_cast<Wide>(c.run.direction * (n + j)), 0, c.run.end_s, 1e-12);
        const auto added = burst.add_ticks * (j * (j - 1) / 2);
        const auto at = static_cast<Wide>(burst.first_ticks + j * burst.interval_ticks + added);
        ASSERT_LE(std::fabs(at - w * c.timer_frequency_hz), allowed) << "pulse " << j << " of burst " << b;
      }
      n += burst.count;
    }
  }
}

}  // namespace
}  // namespace ballast::firmware
