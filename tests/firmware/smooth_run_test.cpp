// The fast path of steps against an evaluation that shares nothing with it: crossings by bisection in long double,
// pulse times by adding up intervals.
#include "firmware/motion/smooth_run.h"

#include <gtest/gtest.h>

#include <array>
#include <random>
#include <string>

#include "firmware/motion/step_generator.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

constexpr StepTiming kTiming{.timer_frequency_hz = 1e7, .control_period_s = 1e-3, .direction_setup_s = 2e-6};
constexpr Wide kToleranceTicks = 5;  // 0.5 us at 10 MHz, which is more than 1 timer tick

long double position(const StepCubic& c, long double w) {
  return c.x + w * (c.velocity + w * (c.acceleration / 2.0L + w * c.jerk / 6.0L));
}

// Where the run, which moves one way only, is at `level`; in timer ticks from the control tick's start.
long double crossing_ticks(const SmoothRun& run, long double level) {
  long double low = run.begin_s, high = run.end_s;
  for (int i = 0; i < 100; ++i) {
    const long double half = (low + high) / 2;
    (run.direction * (position(run.cubic, half) - level) < 0 ? low : high) = half;
  }
  return (run.start_s + high) * kTiming.timer_frequency_hz;
}

// A whole tick with velocity and acceleration of constant sign. No steps where it crosses no level.
SmoothRun random_run(std::mt19937_64& random) {
  const auto in = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  SmoothRun run;
  run.direction = random() % 2 == 0 ? 1 : -1;
  run.end_s = kTiming.control_period_s;
  const double speed = std::pow(10, in(2, 4.7)), change = speed * in(-0.9, 0.9) / run.end_s;
  const double late_change = change * in(0, 1);
  run.cubic = {in(-0.5, 0.5), run.direction * speed, run.direction * change,
               run.direction * (late_change - change) / run.end_s};
  run.first_level = 0.5 * run.direction;
  const long double beyond = run.direction * (position(run.cubic, run.end_s) - run.first_level);
  run.steps = beyond > 0 ? static_cast<int>(beyond) + 1 : 0;
  return run;
}

TEST(SmoothRun, PulsesAreAtTheirCrossingsAndKeepTheirDistances) {
  const std::uint64_t seed = test::random_seed(20241122);
  std::mt19937_64 random(seed);
  int proved = 0, pulses = 0;
  for (int trial = 0; trial < 20'000 && !HasFailure(); ++trial) {
    SCOPED_TRACE("seed " + std::to_string(seed) + " trial " + std::to_string(trial));
    SmoothRun run = random_run(random);
    if (run.steps == 0 || run.steps > kMaxStepsPerTick) continue;
    const Wide fastest_hz = std::max(std::fabs(run.cubic.velocity), std::fabs(run.cubic.velocity_at(run.end_s)));
    const PulseRules rules(kTiming, fastest_hz);
    if (random() % 4 == 0) run.earliest = static_cast<std::int32_t>(random() % 20);
    std::array<StepBurst, kMaxBursts> bursts;
    const auto allowed = 1 + random() % kMaxBursts;
    const int count = smooth_bursts(run, rules, kTiming.timer_frequency_hz, std::span(bursts).first(allowed));
    ASSERT_LE(count, static_cast<int>(allowed));
    if (count == 0) continue;
    ++proved;
    int step = 0;
    std::int64_t before = -1;
    for (int b = 0; b < count; ++b) {
      const StepBurst& burst = bursts[static_cast<std::size_t>(b)];
      ASSERT_EQ(burst.direction, run.direction);
      ASSERT_GE(burst.count, 1);
      std::int64_t at = burst.first_ticks, interval = burst.interval_ticks;
      for (int j = 0; j < burst.count; ++j) {
        const long double exact = crossing_ticks(run, run.first_level + run.direction * static_cast<double>(step));
        EXPECT_LE(std::fabs(static_cast<Wide>(at - exact)), kToleranceTicks) << "pulse " << step;
        EXPECT_GE(at, step == 0 ? run.earliest : before + rules.gap) << "pulse " << step;
        EXPECT_LE(at, rules.last_tick) << "pulse " << step;
        before = at;
        at += interval;
        interval += burst.add_ticks;
        ++step;
      }
    }
    EXPECT_EQ(step, run.steps);
    pulses += step;
  }
  EXPECT_GT(proved, 5'000);
  EXPECT_GT(pulses, 50'000);
}

TEST(SmoothRun, AConstantSpeedTakesOneBurst) {
  SmoothRun run;
  run.cubic = {0, 40'000, 0, 0};
  run.end_s = kTiming.control_period_s;
  run.first_level = 0.5;
  run.steps = 40;
  std::array<StepBurst, 1> bursts;
  const PulseRules rules(kTiming, 40'000);
  ASSERT_EQ(smooth_bursts(run, rules, kTiming.timer_frequency_hz, bursts), 1);
  EXPECT_EQ(bursts[0].count, 40);
  EXPECT_EQ(bursts[0].interval_ticks, 250);
  EXPECT_EQ(bursts[0].add_ticks, 0);
  EXPECT_NEAR(bursts[0].first_ticks, 125, kToleranceTicks);
}

TEST(SmoothRun, ProvesNothingWithTooFewBursts) {
  SmoothRun run;
  run.end_s = kTiming.control_period_s;
  run.cubic = {0, 2'000, 6e7, -1e10};
  run.first_level = 0.5;
  run.steps = static_cast<int>(run.cubic.at(run.end_s) - run.first_level) + 1;
  const PulseRules rules(kTiming, 1e5);
  std::array<StepBurst, kMaxBursts> bursts;
  const int count = smooth_bursts(run, rules, kTiming.timer_frequency_hz, bursts);
  ASSERT_GT(count, 1);
  const auto fewer = std::span(bursts).first(static_cast<std::size_t>(count - 1));
  EXPECT_EQ(smooth_bursts(run, rules, kTiming.timer_frequency_hz, fewer), 0);
  EXPECT_EQ(smooth_bursts(run, rules, kTiming.timer_frequency_hz, {}), 0);
}

// A tick may carry kMaxStepsPerTick pulses. At the greatest step rate of one motor, one pulse fewer per period, a tick
// has at most that number wherever the run stands between two steps. Above it, the tick with one more is refused.
TEST(SmoothRun, ATickAtFullRateHasAtMostItsPulses) {
  const auto steps_at = [](Wide per_tick, Wide start, Wide most_per_tick, StepError& error) {
    Profile profile;
    EXPECT_TRUE(profile.set(start, per_tick / kTiming.control_period_s, nullptr, 0));
    StepCommand command;
    command.motor_count = 1;
    error = generate_steps(profile, 0, 0, 1, most_per_tick / kTiming.control_period_s, kTiming, 0, command);
    int pulses = 0;
    for (int b = 0; b < command.burst_count; ++b) pulses += command.bursts[static_cast<std::size_t>(b)].count;
    EXPECT_EQ(pulses, command.steps[0]);
    return pulses;
  };
  const Wide full = sure_steps_per_tick(1) - 1;
  int fewest = kMaxStepsPerTick, most = 0, refused = 0;
  for (int k = 0; k <= 1000; ++k) {
    SCOPED_TRACE(k);
    const Wide start = 0.5 - k / 1000.0;
    StepError error{};
    const int pulses = steps_at(full * (1 + 0.9e-9), start, full, error);
    EXPECT_EQ(error, StepError::kNone);
    fewest = std::min(fewest, pulses);
    most = std::max(most, pulses);
    EXPECT_LE(steps_at(full + 1.5, start, full + 2, error), kMaxStepsPerTick);
    if (error == StepError::kTooManySteps) ++refused;
  }
  EXPECT_EQ(fewest, kMaxStepsPerTick - 1);
  EXPECT_EQ(most, kMaxStepsPerTick);
  EXPECT_GT(refused, 400);  // about every second one has 65
}

}  // namespace
}  // namespace ballast::firmware
