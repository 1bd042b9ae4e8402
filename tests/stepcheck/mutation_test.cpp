// The checker must be able to fail: good commands, spoilt on purpose, one way at a time.
#include <gtest/gtest.h>

#include <functional>

#include "tests/stepcheck/drives.h"

namespace ballast::stepcheck {
namespace {

// Up to 20 microsteps in a tick, a turn at 0.1 s (where no level lies near) and back; all in 10 MHz and 1 ms.
Drive to_and_fro() {
  Drive d;
  d.timer_frequency_hz = 1e7;
  d.control_period_s = 1e-3;
  d.max_step_rate_hz = 25000;
  d.direction_setup_s = 2e-6;
  d.motion.microsteps_per_unit = 1000;
  d.motion.pieces = {{0.05, 0, 400.1}, {0.05, 0, -400.1}, {0.1, -400.1, 0}, {0.05, 0, 100}};
  return d;
}

struct Said {
  std::vector<Burst> bursts;
  std::int64_t steps, position_steps;
};

std::vector<Said> good_commands(const Drive& drive, int ticks) {
  Generator generator(drive);
  std::vector<Said> commands;
  for (int tick = 0; tick < ticks; ++tick) {
    EXPECT_EQ(generator.tick(), firmware::StepError::kNone);
    commands.push_back({generator.bursts(), generator.command().steps[0], generator.command().position_steps[0]});
  }
  return commands;
}

std::optional<Violation> judge(const Drive& drive, const std::vector<Said>& commands) {
  MotorCheck check(drive);
  for (std::size_t k = 0; k < commands.size(); ++k) {
    const auto violation =
        check.tick(static_cast<std::int64_t>(k), commands[k].bursts, commands[k].steps, commands[k].position_steps);
    if (violation) return violation;
  }
  return std::nullopt;
}

// The sums as a controller would report them that believes in the spoilt pulses.
void sum_up(std::vector<Said>& commands) {
  std::int64_t position = 0;
  for (Said& c : commands) {
    c.steps = 0;
    for (const Burst& b : c.bursts) c.steps += b.direction * b.count;
    c.position_steps = position += c.steps;
  }
}

struct Corruption {
  const char* name;
  std::function<void(std::vector<Said>&, std::size_t)> spoil;  // of a tick whose first burst has at least 3 pulses
  std::vector<Kind> seen_as;
};

const std::vector<Corruption> kCorruptions = {
    {"the last pulse of a burst lost", [](auto& c, auto k) { --c[k].bursts[0].count; }, {Kind::kLost, Kind::kOffTime}},
    {"the first pulse of a burst lost",
     [](auto& c, auto k) {
       Burst& b = c[k].bursts[0];
       b.first += b.interval;
       b.interval += b.add;
       --b.count;
     },
     {Kind::kLost, Kind::kOffTime}},
    {"all pulses of a tick lost", [](auto& c, auto k) { c[k].bursts.clear(); }, {Kind::kLost}},
    {"the last pulse doubled at the next tick's start",
     [](auto& c, auto k) {
       c[k + 1].bursts.insert(c[k + 1].bursts.begin(), {c[k].bursts[0].direction, 1, 0, 0, 0});
     },
     {Kind::kExtra, Kind::kSpacing, Kind::kOffTime}},
    {"a tick's pulses sent again in the next",
     [](auto& c, auto k) { c[k + 1].bursts = c[k].bursts; },
     {Kind::kOffTime, Kind::kExtra, Kind::kLost, Kind::kSpacing}},
    {"a pulse doubled half a step later",
     [](auto& c, auto k) {
       Burst& b = c[k].bursts[0];
       const std::int64_t last = b.first + (b.count - 1) * b.interval + b.add * ((b.count - 1) * (b.count - 2) / 2);
       c[k].bursts.insert(c[k].bursts.begin() + 1, {b.direction, 1, last + 450, 0, 0});
     },
     {Kind::kExtra, Kind::kOutsideTick}},
    {"a burst moved beyond the tolerance", [](auto& c, auto k) { c[k].bursts[0].first += 12; }, {Kind::kOffTime}},
    {"a burst moved to before its crossings", [](auto& c, auto k) { c[k].bursts[0].first -= 12; }, {Kind::kOffTime}},
    {"an interval too long by more than the tolerance allows",
     [](auto& c, auto k) { c[k].bursts[0].interval += 12; },
     {Kind::kOffTime}},
    {"an add too large", [](auto& c, auto k) { c[k].bursts[0].add += 15; }, {Kind::kOffTime}},
    {"the direction flipped",
     [](auto& c, auto k) { c[k].bursts[0].direction *= -1; },
     {Kind::kExtra, Kind::kOffTime, Kind::kLost, Kind::kSetUp}},
    {"the next tick's bursts a tick early",
     [](auto& c, auto k) { std::swap(c[k].bursts, c[k + 1].bursts); },
     {Kind::kOffTime, Kind::kExtra, Kind::kLost, Kind::kSpacing}},
    {"a pulse after the tick's end",
     [](auto& c, auto k) {
       Burst& b = c[k].bursts.back();
       b.first = 10000 - (b.count - 1) * b.interval - b.add * ((b.count - 1) * (b.count - 2) / 2);
     },
     {Kind::kOutsideTick, Kind::kOffTime, Kind::kLost}},
    {"an empty burst", [](auto& c, auto k) { c[k].bursts[0].count = 0; }, {Kind::kMalformed}},
    {"pulses on one another",
     [](auto& c, auto k) { c[k].bursts[0].interval = c[k].bursts[0].add = 0; },
     {Kind::kMalformed}},
    {"no direction", [](auto& c, auto k) { c[k].bursts[0].direction = 0; }, {Kind::kMalformed}},
};

TEST(Corruptions, AreAllCaught) {
  const Drive drive = to_and_fro();
  const auto good = good_commands(drive, 260);
  ASSERT_FALSE(judge(drive, good)) << judge(drive, good)->text();
  for (const Corruption& corruption : kCorruptions) {
    int tried = 0;
    // Up to where the speed hardly changes any more: there one tick's pulses are as good as the next's.
    for (std::size_t k = 30; k < 185; k += 7) {
      if (good[k].bursts.empty() || good[k].bursts[0].count < 3 || good[k].bursts.size() > 1) continue;
      SCOPED_TRACE(::testing::Message() << corruption.name << ", tick " << k);
      auto commands = good;
      corruption.spoil(commands, k);
      sum_up(commands);
      const auto violation = judge(drive, commands);
      ASSERT_TRUE(violation) << "not caught";
      EXPECT_LE(violation->tick, static_cast<std::int64_t>(k) + 1) << violation->text();
      EXPECT_TRUE(std::find(corruption.seen_as.begin(), corruption.seen_as.end(), violation->kind) !=
                  corruption.seen_as.end())
          << violation->text();
      ++tried;
    }
    EXPECT_GT(tried, 10) << corruption.name;
  }
}

TEST(Corruptions, WrongSumsAreCaught) {
  const Drive drive = to_and_fro();
  auto commands = good_commands(drive, 100);
  ++commands[50].steps;
  EXPECT_EQ(judge(drive, commands)->kind, Kind::kCount);
  commands = good_commands(drive, 100);
  --commands[60].position_steps;
  EXPECT_EQ(judge(drive, commands)->kind, Kind::kCount);
  EXPECT_EQ(judge(drive, commands)->tick, 60);
}

// At 1 MHz the tolerance is one timer tick: whatever was rounded to nearest is off by two of them.
TEST(Corruptions, TwoTimerTicksAreCaughtAtOneMegahertz) {
  Drive drive = to_and_fro();
  drive.timer_frequency_hz = 1e6;
  const auto good = good_commands(drive, 260);
  ASSERT_FALSE(judge(drive, good)) << judge(drive, good)->text();
  for (std::size_t k = 30; k < good.size(); k += 3) {
    if (good[k].bursts.empty()) continue;
    for (const int off : {-2, 2}) {
      auto commands = good;
      commands[k].bursts[0].first += off;
      const auto violation = judge(drive, commands);
      ASSERT_TRUE(violation) << "tick " << k;
      EXPECT_EQ(violation->tick, static_cast<std::int64_t>(k));
    }
  }
}

// A speed a hair above the step rate, told as a lower one: the pulses come too close, also where only a border of ticks
// lies between them.
TEST(Corruptions, SpacingIsCheckedAcrossBorders) {
  Drive drive = to_and_fro();
  drive.motion.pieces = {};
  drive.motion.velocity = 20;  // 20 pulses a tick, 500 timer ticks apart, the border half-way between two
  const auto good = good_commands(drive, 20);
  ASSERT_FALSE(judge(drive, good));
  Drive slower = drive;
  slower.max_step_rate_hz = 1e7 / 500;
  EXPECT_FALSE(judge(slower, good)) << "500 timer ticks are allowed";
  slower.max_step_rate_hz = 1e7 / 502;
  ASSERT_TRUE(judge(slower, good));
  EXPECT_EQ(judge(slower, good)->kind, Kind::kSpacing);
  // One pulse a tick, so that all distances go across borders.
  drive.motion.velocity = 1;
  const auto sparse = good_commands(drive, 20);
  slower = drive;
  slower.max_step_rate_hz = 1e7 / 10002;
  ASSERT_TRUE(judge(slower, sparse));
  EXPECT_EQ(judge(slower, sparse)->kind, Kind::kSpacing);
  EXPECT_EQ(judge(slower, sparse)->tick, 1);
}

TEST(Corruptions, SetUpTimeIsCheckedAcrossBorders) {
  Drive drive = to_and_fro();
  MotorCheck check(drive);
  check.leave_motion();
  const Burst up{1, 1, 9990, 0, 0}, down{-1, 1, 400, 0, 0};
  EXPECT_FALSE(check.tick(0, std::vector{up}, 1, 1));
  EXPECT_FALSE(check.tick(1, std::vector{down}, -1, 0)) << "410 timer ticks; 400 are 25 kHz";
  drive.direction_setup_s = 41.1e-6;
  MotorCheck strict(drive);
  strict.leave_motion();
  EXPECT_FALSE(strict.tick(0, std::vector{up}, 1, 1));
  const auto violation = strict.tick(1, std::vector{down}, -1, 0);
  ASSERT_TRUE(violation);
  EXPECT_EQ(violation->kind, Kind::kSetUp);
  EXPECT_NEAR(violation->value, 41.0, 1e-9);
}

// The generator told of a laxer motor than the checker: a reversal just after a border.
TEST(Corruptions, AReversalStraddlingABorderIsATouch) {
  // x = 1/2 + h - (a/2) (t - border)^2 crosses 1/2 upward 20 us before the border and downward 20 us after it.
  Drive drive;
  drive.timer_frequency_hz = 1e7;
  drive.control_period_s = 1e-3;
  drive.max_step_rate_hz = 1e6;
  drive.motion.microsteps_per_unit = 1;
  const double a = 2 * 0.5 / (1e-6 - 4e-10);  // 1/2 from t = 0 to 20 us before the border
  drive.motion.velocity = a * 1e-3;
  drive.motion.pieces = {{0.01, -a, -a}};
  drive.direction_setup_s = 30e-6;  // less than the 40 us between the two
  const auto stepped = good_commands(drive, 3);
  EXPECT_EQ(stepped[0].steps, 1);
  EXPECT_EQ(stepped[1].steps < 0, true);
  EXPECT_FALSE(judge(drive, stepped));
  Drive strict = drive;
  strict.direction_setup_s = 45e-6;
  const auto touched = good_commands(strict, 1);
  EXPECT_EQ(touched[0].steps, 0) << "it looks ahead over the border";
  EXPECT_FALSE(judge(strict, touched));
  const auto violation = judge(strict, stepped);
  ASSERT_TRUE(violation) << "without looking ahead the pulses would come too close";
  EXPECT_EQ(violation->kind, Kind::kSetUp);
  EXPECT_EQ(violation->tick, 1);
}

}  // namespace
}  // namespace ballast::stepcheck
