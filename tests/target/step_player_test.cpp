// The step interrupt's work, with a timer and pins of the test's: every pulse of a command, at its time, whatever the
// two clocks' ratio.
#include "hal/target/step_player.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/random_seed.h"

namespace ballast::hal::target {
namespace {

struct FakePins {
  static inline std::uint32_t time = 0, armed = 0, length = 0;
  struct Pulse {
    std::uint32_t time;
    std::uint8_t motor;
    std::int8_t direction;
  };
  static inline std::vector<Pulse> pulses;
  static std::uint32_t span() { return length - 1; }
  static std::uint32_t left() { return length - 1 - time; }
  static void arm(std::uint32_t counts) { armed = counts; }
  static void cancel() { armed = 0xffffffff; }
  static inline std::int8_t directions[8] = {};
  static std::uint32_t pin(std::uint8_t motor) { return motor; }
  static void step(std::uint32_t pin) { pulses.push_back({time, static_cast<std::uint8_t>(pin), directions[pin]}); }
  static void turn(std::uint8_t motor, std::int8_t direction) { directions[motor] = direction; }
};

// Runs the control tick to its end; `late` counts pass before each interrupt is served.
void play(StepPlayer<FakePins>& player, std::uint32_t late) {
  FakePins::time = 0;
  FakePins::pulses.clear();
  player.begin_tick();
  while (FakePins::armed < FakePins::length - std::min(FakePins::length, FakePins::time + late)) {
    FakePins::time += FakePins::armed + late;
    player.on_timer();
  }
}

// Random bursts: every pulse at its time, in its direction, and in the record.
void expect_pulses_at_their_time(double timer_hz, double counter_hz, int rounds, std::mt19937_64& random) {
  StepPlayer<FakePins> player;
  const double ratio = counter_hz / timer_hz;
  player.configure(ratio);
  FakePins::length = static_cast<std::uint32_t>(0.001 * counter_hz);
  const auto last = static_cast<std::int64_t>(0.001 * timer_hz) - 1;
  for (int round = 0; round < rounds; ++round) {
    // Bursts one after the other, each motor its own.
    firmware::StepCommand command;
    command.motor_count = 1 + static_cast<int>(random() % 8);
    std::vector<std::vector<std::pair<std::int64_t, int>>> expected(8);
    for (int motor = 0; motor < command.motor_count; ++motor) {
      std::int64_t from = static_cast<std::int64_t>(random() % 50);
      for (int b = 0; b < 4 && from < last - 100; ++b) {
        firmware::StepBurst burst{.motor = static_cast<std::uint8_t>(motor),
                                  .direction = static_cast<std::int8_t>(random() % 2 == 0 ? 1 : -1),
                                  .first_ticks = static_cast<std::int32_t>(from),
                                  .interval_ticks = 10 + static_cast<std::int32_t>(random() % 40),
                                  .add_ticks = static_cast<std::int32_t>(random() % 3) - 1};
        const int wanted = 1 + static_cast<int>(random() % 10);
        for (std::int64_t j = 0; j < wanted; ++j) {
          const std::int64_t at = from + j * burst.interval_ticks + burst.add_ticks * (j * (j - 1) / 2);
          if (at > last) break;
          expected[static_cast<std::size_t>(motor)].push_back({at, burst.direction});
          ++burst.count;
        }
        from = expected[static_cast<std::size_t>(motor)].back().first + 5;
        command.bursts[static_cast<std::size_t>(command.burst_count++)] = burst;
      }
    }
    player.load(command);
    play(player, 0);
    std::vector<std::size_t> seen(8);
    for (const auto& pulse : FakePins::pulses) {
      const auto& motor = expected[pulse.motor];
      ASSERT_LT(seen[pulse.motor], motor.size());
      const auto [at, direction] = motor[seen[pulse.motor]++];
      EXPECT_EQ(pulse.direction, direction);
      // Counts are whole, up to one before the exact time, and armed a count late. The ratio is rounded up, by less
      // than 2^-32 counts for each unit of the player's time: a timer tick has at most 2 ratio of them, or 1.
      const double rounding = static_cast<double>(at) * std::max(2 * ratio, 1.0) * 0x1p-32;
      EXPECT_LE(pulse.time, static_cast<double>(at) * ratio + 1 + rounding + 1e-6);
      EXPECT_GT(pulse.time, static_cast<double>(at) * ratio - 1);
    }
    player.begin_tick();  // nothing was loaded: closes the record
    PlayedPulses played;
    player.played(played);
    std::size_t total = 0;
    for (std::size_t m = 0; m < 8; ++m) total += expected[m].size();
    ASSERT_EQ(static_cast<std::size_t>(played.count), total);
    std::vector<std::size_t> recorded(8);
    for (std::size_t i = 0; i < total; ++i) {
      const auto& [at, direction] = expected[played.pulse[i].motor][recorded[played.pulse[i].motor]++];
      EXPECT_EQ(played.pulse[i].due_ticks, at);
      EXPECT_EQ(played.pulse[i].direction, direction);
      // No time passes here; one that is due with the tick's end, in the next.
      EXPECT_LE(played.pulse[i].late_counts, 1);
    }
  }
}

class StepPlayerAtRatio : public testing::TestWithParam<std::pair<double, double>> {};

TEST_P(StepPlayerAtRatio, PulsesComeAtTheirTime) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  expect_pulses_at_their_time(GetParam().first, GetParam().second, 200, random);
}

INSTANTIATE_TEST_SUITE_P(Clocks, StepPlayerAtRatio,
                         testing::Values(std::pair(1e7, 25e6), std::pair(1e6, 25e6), std::pair(1e8, 25e6),
                                         std::pair(25e6, 25e6), std::pair(3.3e6, 216e6),
                                         std::pair(25000000.001, 25e6),  // just under 1: rounded up it is 2^32
                                         std::pair(12500000.0005, 25e6), std::pair(1e6, std::nextafter(4096e6, 0))));

// Any ratio, also those a rounding away from a power of two.
TEST(StepPlayer, PulsesComeAtTheirTimeAtRandomRatios) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> log_timer(std::log(1e6), std::log(1e8)),
      log_counter(std::log(1e7), std::log(5e8));
  for (int i = 0; i < 100; ++i) {
    const double counter_hz = std::exp(log_counter(random));
    double timer_hz = std::exp(log_timer(random));
    if (i % 2 == 0) {
      const double near = std::exp2(std::round(std::log2(counter_hz / timer_hz)));
      const int ulps = static_cast<int>(random() % 4);
      const double towards = random() % 2 == 0 ? 0 : 1e9;
      timer_hz = counter_hz / near;
      for (int k = 0; k < ulps; ++k) timer_hz = std::nextafter(timer_hz, towards);
    }
    SCOPED_TRACE("timer " + std::to_string(timer_hz) + " Hz, counter " + std::to_string(counter_hz) + " Hz");
    ASSERT_NO_FATAL_FAILURE(expect_pulses_at_their_time(timer_hz, counter_hz, 5, random));
  }
}

// The interrupts come back for every command, ratio and delay, and give no more pulses than the record holds.
TEST(StepPlayer, IsBoundedWhateverItIsGiven) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> log_ratio(std::log(1.0 / 32), std::log(4095.999));
  for (int round = 0; round < 3000; ++round) {
    StepPlayer<FakePins> player;
    const double special[] = {1 - 0x1p-53, 1 - 0x1p-33, 1.0 / 32, 0.5 - 0x1p-54, 4096 - 0x1p-41};
    player.configure(round % 4 == 0 ? special[random() % 5] : std::exp(log_ratio(random)));
    FakePins::length = 2 + static_cast<std::uint32_t>(random() % (1 << 24));
    for (int tick = 0; tick < 3; ++tick) {
      firmware::StepCommand command;
      command.motor_count = static_cast<int>(random() % 10);
      command.burst_count = static_cast<int>(random() % (firmware::kMaxBursts + 2));
      const int most = round % 2 == 0 ? 3 : 40;  // more than fits, also
      for (auto& burst : command.bursts) {
        const auto number = [&] { return static_cast<std::int32_t>(random() >> random() % 64); };
        burst = {.motor = static_cast<std::uint8_t>(random() % 9),
                 .direction = 1,
                 .count = static_cast<std::int16_t>(static_cast<int>(random() % 200) == 0 ? -1 : random() % most),
                 .first_ticks = number(),
                 .interval_ticks = number(),
                 .add_ticks = number()};
      }
      player.load(command);
      FakePins::time = 0;
      FakePins::pulses.clear();
      player.begin_tick();
      for (int i = 0; i < 1000 && FakePins::armed < FakePins::length - FakePins::time; ++i) {
        FakePins::time += FakePins::armed;
        if (random() % 4 == 0) {
          FakePins::time += static_cast<std::uint32_t>(random() % (FakePins::length - FakePins::time));
        }
        player.on_timer();
      }
      ASSERT_LE(FakePins::pulses.size(), static_cast<std::size_t>(kMaxPulses) + firmware::kMaxMasses);
      PlayedPulses played;
      player.played(played);
      ASSERT_LE(played.count, kMaxPulses);
    }
  }
}

// Held up beyond the tick's end, a motor's pulses do not come one upon the other: the first is given, late, and the
// record lacks the others.
TEST(StepPlayer, GivesOnlyOneMissedPulsePerMotor) {
  StepPlayer<FakePins> player;
  player.configure(2.5);
  FakePins::length = 25000;
  firmware::StepCommand command;
  command.motor_count = command.burst_count = 2;
  command.bursts[0] = {.motor = 0, .direction = 1, .count = 3, .first_ticks = 9000, .interval_ticks = 100};
  command.bursts[1] = {.motor = 1, .direction = -1, .count = 1, .first_ticks = 9500};
  player.load(command);
  FakePins::time = 0;
  player.begin_tick();
  FakePins::pulses.clear();
  FakePins::time = 3;
  player.begin_tick();
  EXPECT_EQ(FakePins::pulses.size(), 2u);
  PlayedPulses played;
  player.played(played);
  ASSERT_EQ(played.count, 2);
  EXPECT_EQ(played.pulse[0].motor, 0);
  EXPECT_EQ(played.pulse[0].due_ticks, 9000u);
  EXPECT_EQ(played.pulse[0].late_counts, 25000 + 3 - 22500);
  EXPECT_EQ(played.pulse[1].motor, 1);
  FakePins::pulses.clear();
  play(player, 0);
  EXPECT_TRUE(FakePins::pulses.empty());
}

TEST(StepPlayer, SaysHowLateAPulseWas) {
  StepPlayer<FakePins> player;
  player.configure(2.5);
  FakePins::length = 25000;
  firmware::StepCommand command;
  command.motor_count = command.burst_count = 1;
  command.bursts[0] = {.motor = 0, .direction = 1, .count = 2, .first_ticks = 100, .interval_ticks = 9899};
  player.load(command);
  play(player, 30);
  ASSERT_EQ(FakePins::pulses.size(), 1u);  // the second one's interrupt comes after the tick's end,
  FakePins::time = 4;                      // where the next tick's begins with it
  player.begin_tick();
  PlayedPulses played;
  player.played(played);
  ASSERT_EQ(played.count, 2);
  EXPECT_EQ(played.pulse[0].late_counts, 31);
  EXPECT_EQ(played.pulse[1].late_counts, 25000 + 4 - 24997);  // 9999 * 2.5 = 24997.5
}

// A pulse of the last count, whose interrupt comes in time but is so long under way that the tick's timer has begun
// anew.
TEST(StepPlayer, SaysHowLateAPulseWasAcrossTheTicksEnd) {
  StepPlayer<FakePins> player;
  player.configure(2.5);
  FakePins::length = 25000;
  firmware::StepCommand command;
  command.motor_count = command.burst_count = 1;
  command.bursts[0] = {.motor = 0, .direction = 1, .count = 1, .first_ticks = 9999};
  player.load(command);
  FakePins::time = 0;
  player.begin_tick();
  FakePins::time = 2;
  player.on_timer();
  FakePins::time = 5;
  player.begin_tick();
  PlayedPulses played;
  player.played(played);
  ASSERT_EQ(played.count, 1);
  EXPECT_EQ(played.pulse[0].late_counts, 25000 + 2 - 24997);
}

// The step timer of a cancelled interrupt counts on, over all ticks of a rest: it must never come to its end.
TEST(StepPlayer, NothingComesOfALongRest) {
  StepPlayer<FakePins> player;
  player.configure(2.5);
  FakePins::length = 1 << 24;  // the longest tick
  FakePins::armed = 1;         // by whoever was there before
  for (int tick = 0; tick < 1000; ++tick) {
    FakePins::time = 0;
    player.begin_tick();
    ASSERT_GT(FakePins::armed, FakePins::length) << tick;
    FakePins::armed -= FakePins::length;
  }
}

TEST(StepPlayer, GivesNothingThatWasNotLoaded) {
  StepPlayer<FakePins> player;
  player.configure(2.5);
  FakePins::length = 25000;
  firmware::StepCommand command;
  command.motor_count = command.burst_count = 1;
  command.bursts[0] = {.motor = 0, .direction = 1, .count = 3, .first_ticks = 100, .interval_ticks = 100};
  player.load(command);
  play(player, 0);
  EXPECT_EQ(FakePins::pulses.size(), 3u);
  play(player, 0);
  EXPECT_EQ(FakePins::pulses.size(), 0u);
}

}  // namespace
}  // namespace ballast::hal::target
