#include "firmware/motion/step_generator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iostream>
#include <random>
#include <vector>

#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

struct Pulse {
  std::int64_t timer_tick;  // from the control tick's start
  int direction;
};

// The formula of the step_command_t contract, in wide integers.
std::vector<Pulse> replay(const StepCommand& command, int motor) {
  std::vector<Pulse> pulses;
  for (int b = 0; b < command.burst_count; ++b) {
    const StepBurst& burst = command.bursts[static_cast<std::size_t>(b)];
    if (burst.motor != motor) continue;
    for (std::int64_t j = 0; j < burst.count; ++j) {
      pulses.push_back(
          {burst.first_ticks + j * burst.interval_ticks + j * (j - 1) / 2 * burst.add_ticks, burst.direction});
    }
  }
  return pulses;
}

// (p(t) - p_zero) * steps_per_unit in long double, straight from the pieces.
class Exact {
 public:
  Exact(long double p, long double v, const std::vector<ProfilePiece>& pieces, long double zero, long double scale)
      : zero_(zero), scale_(scale) {
    long double t = 0;
    for (const ProfilePiece& piece : pieces) {
      const long double d = piece.duration_s, a = piece.acceleration_start;
      const long double j = (piece.acceleration_end - a) / d;
      parts_.push_back({t, p, v, a, j});
      p += d * (v + d * (a / 2 + d * j / 6));
      v += d * (a + d * j / 2);
      t += d;
    }
    parts_.push_back({t, p, v, 0, 0});
  }
  [[nodiscard]] long double operator()(long double t) const {
    const Part& q = part(t);
    const long double s = std::max(t, 0.0L) - q.start;
    return scale_ * (q.p - zero_ + s * (q.v + s * (q.a / 2 + s * q.j / 6)));
  }
  [[nodiscard]] long double velocity(long double t) const {
    const Part& q = part(t);
    const long double s = std::max(t, 0.0L) - q.start;
    return scale_ * (q.v + s * (q.a + s * q.j / 2));
  }

 private:
  struct Part {
    long double start, p, v, a, j;
  };
  [[nodiscard]] const Part& part(long double t) const {
    std::size_t i = parts_.size() - 1;
    while (i > 0 && parts_[i].start > t) --i;
    return parts_[i];
  }
  long double zero_, scale_;
  std::vector<Part> parts_;
};

struct Drive {
  std::vector<ProfilePiece> pieces;
  Real start = 0, velocity = 0, zero = 0, scale = 1, max_rate_hz = 1e9;
  StepTiming timing;
  [[nodiscard]] Profile profile() const {
    Profile p;
    EXPECT_TRUE(p.set(start, velocity, pieces.data(), static_cast<int>(pieces.size())));
    return p;
  }
};

Drive random_drive(std::mt19937& random) {
  std::uniform_real_distribution<Real> u(-1, 1);
  const Real frequencies[] = {1e5, 1e6, 1e7, 168e6};
  const Real periods[] = {1e-3, 1.0 / 3000, 2e-3};
  Drive s;
  s.timing = {frequencies[random() % 4], periods[random() % 3]};
  s.max_rate_hz = s.timing.timer_frequency_hz / 2;
  s.scale = std::copysign(std::exp(3 * u(random) + 6), u(random));  // 20..8000 microsteps per unit
  const Real ticks = s.timing.timer_frequency_hz * s.timing.control_period_s;
  const Real most = std::min(40.0, ticks / 8) / (std::fabs(s.scale) * s.timing.control_period_s);  // unit/s
  s.start = u(random);
  s.zero = s.start;
  s.velocity = most * u(random);
  // Each piece aims at a random velocity in range, through an acceleration that is not constant; some last less than a
  // tick.
  Real v = s.velocity;
  for (int i = 0; i < 40; ++i) {
    const Real d = s.timing.control_period_s * (i % 4 == 0 ? 0.3 + 0.2 * u(random) : 30 + 25 * u(random));
    const Real mean = (most * u(random) - v) / d;
    const Real slope = i % 4 == 0 ? 0 : 0.5 * std::fabs(mean) * u(random);
    s.pieces.push_back({d, mean - slope, mean + slope});
    v += mean * d;
  }
  return s;
}

// Is there a crossing of `level` in `direction` within tolerance of t?
bool crosses(const Exact& x, long double t, long double tolerance, long double level, int direction) {
  const long double slack = 1e-9L;  // microsteps: double rounding of positions of up to 1e5 microsteps
  const auto side = [&](long double when) { return direction * (x(when) - level); };
  if (side(t - tolerance) <= slack && side(t + tolerance) >= -slack) return true;
  // A reversal close by: look for the rise itself.
  const int n = 400;
  for (int i = 0; i < n; ++i) {
    const long double a = t - tolerance + 2 * tolerance * i / n, b = t - tolerance + 2 * tolerance * (i + 1) / n;
    if (side(a) <= slack && side(b) >= -slack) return true;
  }
  return false;
}

// Every pulse is at a crossing, and between pulses the profile never strays from the count: together, none lost or
// doubled.
TEST(StepGenerator, MillionsOfRandomCrossings) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(31337));
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> inside(0, 1);
  std::int64_t total = 0, reversals = 0;
  for (int k = 0; total < 2'000'000; ++k) {
    ASSERT_LT(k, 2000);
    const Drive s = random_drive(random);
    const Profile profile = s.profile();
    const Exact x(s.start, s.velocity, s.pieces, s.zero, s.scale);
    const long double f = s.timing.timer_frequency_hz, period = s.timing.control_period_s;
    const long double tolerance = std::max(1 / f, 0.5e-6L) * (1 + 1e-9L);
    const auto ticks = static_cast<std::int64_t>(profile.end_s() / s.timing.control_period_s) + 5;
    std::int64_t count = 0;
    LastPulse last_pulse;
    for (std::int64_t tick = 0; tick < ticks; ++tick) {
      StepCommand out;
      out.tick = tick;
      out.position_steps[3] = count;
      out.last_pulse[3] = last_pulse;
      const Real t0 = static_cast<Real>(tick) * s.timing.control_period_s;
      ASSERT_EQ(generate_steps(profile, t0, s.zero, s.scale, s.max_rate_hz, s.timing, 3, out), StepError::kNone)
          << "seed " << seed << " case " << k << " tick " << tick;
      const std::vector<Pulse> pulses = replay(out, 3);
      std::int64_t last = -1, running = count;
      for (std::size_t j = 0; j < pulses.size(); ++j) {
        const Pulse& p = pulses[j];
        ASSERT_GT(p.timer_tick, last) << "seed " << seed << " case " << k << " tick " << tick;
        last = p.timer_tick;
        const long double level = running + p.direction * 0.5L;
        ASSERT_TRUE(crosses(x, t0 + p.timer_tick / f, tolerance, level, p.direction))
            << "seed " << seed << " case " << k << " tick " << tick << " pulse " << j;
        running += p.direction;
        if (j > 0 && pulses[j - 1].direction != p.direction) ++reversals;
      }
      ASSERT_LT(last / f, period);
      ASSERT_EQ(out.steps[3], running - count);
      ASSERT_EQ(out.position_steps[3], running);

      // Between pulses. A touch shorter than the shortest pair allowed may stay unstepped.
      const long double shortest = std::max(tolerance, 1 / (long double)s.max_rate_hz);
      for (int i = 0; i < 12; ++i) {
        const long double w = period * inside(random);
        std::int64_t n = count;
        for (const Pulse& p : pulses) n += p.timer_tick / f <= w ? p.direction : 0;
        const long double reach =
            std::max(std::fabs(x(t0 + w + tolerance) - x(t0 + w)), std::fabs(x(t0 + w - tolerance) - x(t0 + w)));
        const long double bend = std::fabs(x.velocity(t0 + w + shortest) - x.velocity(t0 + w - shortest)) * shortest;
        ASSERT_LE(std::fabs(x(t0 + w) - n), 0.5L + reach + bend + 1e-9L)
            << "seed " << seed << " case " << k << " tick " << tick;
      }
      count = running;
      last_pulse = out.last_pulse[3];
      ASSERT_LE(std::fabs(x(t0 + period) - count), 0.5L + 1e-9L)
          << "seed " << seed << " case " << k << " tick " << tick;
      total += static_cast<std::int64_t>(pulses.size());
    }
  }
  EXPECT_GT(reversals, 100) << "reversals inside a tick have to occur for this test to mean anything";
  std::cout << "seed " << seed << ": " << total << " pulses, " << reversals << " reversals inside a tick\n";
}

// One to one against a list of crossings made by dense scan and bisection, over all ticks.
TEST(StepGenerator, SameCrossingsAsADenseScan) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(271828));
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  for (int k = 0; k < 20; ++k) {
    Drive s = random_drive(random);
    s.timing.timer_frequency_hz = 1e7;
    const Profile profile = s.profile();
    const Exact x(s.start, s.velocity, s.pieces, s.zero, s.scale);
    const long double period = s.timing.control_period_s;
    const auto ticks = static_cast<std::int64_t>(profile.end_s() / s.timing.control_period_s) + 5;

    std::vector<std::pair<long double, int>> expected;
    const int per_tick = 1000;
    long double before = x(0), t_before = 0;
    for (std::int64_t i = 1; i <= ticks * per_tick; ++i) {
      const long double t = period * i / per_tick, now = x(t);
      for (long double n = std::round(before); std::fabs(now - n) > 0.5L; n = n + (now > n ? 1 : -1)) {
        const int direction = now > n ? 1 : -1;
        long double low = t_before, high = t;
        for (int j = 0; j < 70; ++j) {
          const long double middle = (low + high) / 2;
          (direction * (x(middle) - n) < 0.5L ? low : high) = middle;
        }
        expected.emplace_back(low, direction);
      }
      before = now;
      t_before = t;
    }

    std::vector<std::pair<long double, int>> found;
    std::int64_t count = 0;
    for (std::int64_t tick = 0; tick < ticks; ++tick) {
      StepCommand out;
      out.position_steps[0] = count;
      const Real t0 = static_cast<Real>(tick) * s.timing.control_period_s;
      ASSERT_EQ(generate_steps(profile, t0, s.zero, s.scale, s.max_rate_hz, s.timing, 0, out), StepError::kNone);
      for (const Pulse& p : replay(out, 0)) found.emplace_back(t0 + p.timer_tick / 1e7L, p.direction);
      count = out.position_steps[0];
    }
    ASSERT_EQ(found.size(), expected.size()) << "seed " << seed << " case " << k;
    for (std::size_t i = 0; i < found.size(); ++i) {
      ASSERT_EQ(found[i].second, expected[i].second) << "seed " << seed << " case " << k << " pulse " << i;
      ASSERT_NEAR(static_cast<Real>(found[i].first - expected[i].first), 0, 0.5001e-6)
          << "seed " << seed << " case " << k << " pulse " << i << ": the contract's 0.5 us";
    }
  }
}

// Binary fractions from here on, so that borders and touches are exact.
constexpr StepTiming kBinary{1048576, 1.0 / 1024};  // 1024 timer ticks per control tick

TEST(StepGenerator, ConstantVelocityIsOneBurstAtKnownTimes) {
  Drive s{{}, 0, 16 * 1024, 0, 1, 1e6, kBinary};  // 16 microsteps per tick, one every 64 timer ticks
  StepCommand out;
  ASSERT_EQ(generate_steps(s.profile(), 0, 0, 1, 1e6, kBinary, 0, out), StepError::kNone);
  ASSERT_EQ(out.burst_count, 1);
  EXPECT_EQ(out.bursts[0].first_ticks, 32);
  EXPECT_EQ(out.bursts[0].interval_ticks, 64);
  EXPECT_EQ(out.bursts[0].add_ticks, 0);
  EXPECT_EQ(out.bursts[0].count, 16);
  EXPECT_EQ(out.bursts[0].direction, 1);
  EXPECT_EQ(out.steps[0], 16);
  EXPECT_EQ(out.position_steps[0], 16);
}

TEST(StepGenerator, ACrossingOnTheBorderBelongsToTheLaterTick) {
  for (const Real sign : {1.0, -1.0}) {
    const Drive s{{}, 0, 512, 0, sign, 1e6, kBinary};  // half a microstep per tick
    const Profile profile = s.profile();
    StepCommand out;
    std::vector<std::int64_t> count;
    for (int tick = 0; tick < 6; ++tick) {
      out.burst_count = 0;
      out.tick = tick;
      ASSERT_EQ(generate_steps(profile, tick / 1024.0, 0, sign, 1e6, kBinary, 0, out), StepError::kNone);
      const std::vector<Pulse> pulses = replay(out, 0);
      ASSERT_EQ(pulses.size(), tick % 2 == 1 ? 1u : 0u) << "crossings at the start of ticks 1, 3, 5";
      if (!pulses.empty()) {
        EXPECT_EQ(pulses[0].timer_tick, 0);
        EXPECT_EQ(pulses[0].direction, sign);
      }
    }
    EXPECT_EQ(out.position_steps[0], 3 * sign);
  }
}

TEST(StepGenerator, SeveralStepsUpToAHalfWayLevelLeaveTheLastToTheNextTick) {
  for (const Real sign : {1.0, -1.0}) {
    const Drive s{{}, 0, 2560, 0, sign, 1e6, kBinary};  // 2.5 microsteps per tick, all in one monotone span
    const Profile profile = s.profile();
    StepCommand out;
    ASSERT_EQ(generate_steps(profile, 0, 0, sign, 1e6, kBinary, 0, out), StepError::kNone);
    EXPECT_EQ(out.position_steps[0], 2 * sign) << "it comes from 2 and ends at 2.5";
    EXPECT_EQ(replay(out, 0).size(), 2u);
    out.burst_count = 0;
    out.tick = 1;
    ASSERT_EQ(generate_steps(profile, 1.0 / 1024, 0, sign, 1e6, kBinary, 0, out), StepError::kNone);
    EXPECT_EQ(out.position_steps[0], 5 * sign);
    const std::vector<Pulse> pulses = replay(out, 0);
    ASSERT_EQ(pulses.size(), 3u);  // of 2.5, 3.5 and 4.5
    EXPECT_EQ(pulses[0].timer_tick, 0);
    EXPECT_EQ(pulses[0].direction, sign);
  }
}

TEST(StepGenerator, ATouchOfAHigherLevelIsNoStepEither) {
  // x = v w - a w^2 / 2 peaks at v^2 / (2 a) = 5/2 for v = 5 * 2^10, a = 5 * 2^20, at w = 1/1024.
  const ProfilePiece piece{1, -5242880, -5242880};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 5120, &piece, 1));
  for (const Real sign : {1.0, -1.0}) {
    // Inside a tick: two steps there, two back.
    StepCommand out;
    ASSERT_EQ(generate_steps(profile, 0, 0, sign, 1e6, {1048576, 1.0 / 512}, 0, out), StepError::kNone);
    const std::vector<Pulse> pulses = replay(out, 0);
    ASSERT_EQ(pulses.size(), 4u);
    for (std::size_t j = 0; j < 4; ++j) EXPECT_EQ(pulses[j].direction, j < 2 ? sign : -sign);
    EXPECT_EQ(out.position_steps[0], 0);
    // On the border between two ticks: two steps in the one, back in the other.
    StepCommand split;
    ASSERT_EQ(generate_steps(profile, 0, 0, sign, 1e6, kBinary, 0, split), StepError::kNone);
    EXPECT_EQ(split.position_steps[0], 2 * sign);
    split.tick = 1;
    ASSERT_EQ(generate_steps(profile, 1.0 / 1024, 0, sign, 1e6, kBinary, 0, split), StepError::kNone);
    EXPECT_EQ(split.position_steps[0], 0);
    EXPECT_EQ(replay(split, 0).size(), 4u);
  }
}

TEST(StepGenerator, ATouchIsNoStep) {
  // x = v w - a w^2 / 2 peaks at v^2 / (2 a): exactly 1/2 for v = 1024, a = 2^20, in the middle of the first two ticks.
  for (const Real sign : {1.0, -1.0}) {
    for (const Real t0 : {0.0, 1.0 / 2048}) {
      const ProfilePiece piece{1, -1048576, -1048576};
      Profile profile;
      ASSERT_TRUE(profile.set(0, 1024, &piece, 1));
      StepCommand out;
      const StepTiming timing{1048576, t0 == 0 ? 1.0 / 512 : 1.0 / 1024};
      ASSERT_EQ(generate_steps(profile, t0, 0, sign, 1e6, timing, 0, out), StepError::kNone);
      EXPECT_EQ(out.burst_count, 0);
      // A rounding error beyond the level is a touch too; a thousandth of a step is there and back.
      ASSERT_EQ(generate_steps(profile, t0, 0, sign * (1 + 1e-13), 1e6, timing, 0, out), StepError::kNone);
      EXPECT_EQ(out.burst_count, 0);
      ASSERT_EQ(generate_steps(profile, t0, 0, sign * 1.002, 1e6, timing, 0, out), StepError::kNone);
      const std::vector<Pulse> pulses = replay(out, 0);
      ASSERT_EQ(pulses.size(), 2u);
      EXPECT_EQ(pulses[0].direction, sign);
      EXPECT_EQ(pulses[1].direction, -sign);
      EXPECT_EQ(out.position_steps[0], 0);
    }
  }
}

TEST(StepGenerator, ATouchSplitByABorder) {
  // The same peak, exactly on the border between two ticks: neither may step.
  const ProfilePiece piece{1, -1048576, -1048576};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 1024, &piece, 1));
  StepCommand out;
  ASSERT_EQ(generate_steps(profile, 0, 0, 1, 1e6, kBinary, 0, out), StepError::kNone);
  ASSERT_EQ(generate_steps(profile, 1.0 / 1024, 0, 1, 1e6, kBinary, 0, out), StepError::kNone);
  EXPECT_EQ(out.burst_count, 0);
  EXPECT_EQ(out.position_steps[0], 0);
}

TEST(StepGenerator, AStopOnALevelKeepsTheCountForGood) {
  // Comes to rest exactly half-way, and stays there.
  const ProfilePiece piece{1.0 / 1024, -1048576, -1048576};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 1024, &piece, 1));
  ASSERT_EQ(profile.at(1).position, 0.5);
  StepCommand out;
  for (int tick = 0; tick < 100; ++tick) {
    out.tick = tick;
    ASSERT_EQ(generate_steps(profile, tick / 1024.0, 0, 1, 1e6, kBinary, 0, out), StepError::kNone);
  }
  EXPECT_EQ(out.burst_count, 0);
}

TEST(StepGenerator, ReversalInsideATickGoesAndComesBack) {
  // x = 8192 w - 8388608 w^2: up to 2 at w = 1/2048, back to 0 at the tick's end, with 0.5 and 1.5 crossed both ways.
  const ProfilePiece piece{1, -16777216, -16777216};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 8192, &piece, 1));
  StepCommand out;
  ASSERT_EQ(generate_steps(profile, 0, 0, 1, 1e6, kBinary, 0, out), StepError::kNone);
  const std::vector<Pulse> pulses = replay(out, 0);
  ASSERT_EQ(pulses.size(), 4u);
  const Real root[] = {0.5 * (1 - std::sqrt(0.75)), 0.5 * (1 - 0.5), 0.5 * (1 + 0.5), 0.5 * (1 + std::sqrt(0.75))};
  for (std::size_t j = 0; j < 4; ++j) {
    EXPECT_NEAR(static_cast<Real>(pulses[j].timer_tick), 1024 * root[j], 1) << "one timer tick";
    EXPECT_EQ(pulses[j].direction, j < 2 ? 1 : -1);
  }
  EXPECT_EQ(out.position_steps[0], 0);
}

TEST(StepGenerator, ManyPiecesInOneTick) {
  // 100 pieces of 1/128 tick, all of the same straight line, broken up: the same pulses as without.
  std::vector<ProfilePiece> pieces(100, ProfilePiece{1.0 / 131072, 0, 0});
  Profile broken, whole;
  ASSERT_TRUE(broken.set(0, 20000, pieces.data(), 100));
  ASSERT_TRUE(whole.set(0, 20000, nullptr, 0));
  StepCommand a, b;
  ASSERT_EQ(generate_steps(broken, 0, 0, 1, 1e6, kBinary, 0, a), StepError::kNone);
  ASSERT_EQ(generate_steps(whole, 0, 0, 1, 1e6, kBinary, 0, b), StepError::kNone);
  const std::vector<Pulse> p = replay(a, 0), q = replay(b, 0);
  ASSERT_EQ(p.size(), 20u);
  ASSERT_EQ(p.size(), q.size());
  for (std::size_t j = 0; j < p.size(); ++j) {
    const Real crossing = 1048576 * (static_cast<Real>(j) + 0.5) / 20000;
    EXPECT_NEAR(static_cast<Real>(p[j].timer_tick), crossing, 1) << "one timer tick";
    EXPECT_NEAR(static_cast<Real>(q[j].timer_tick), crossing, 1);
  }
}

TEST(StepGenerator, NothingBeforeZero) {
  Profile profile;
  ASSERT_TRUE(profile.set(0, 1024, nullptr, 0));
  StepCommand out;
  ASSERT_EQ(generate_steps(profile, -1.0 / 1024, 0, 1, 1e6, kBinary, 0, out), StepError::kNone);
  EXPECT_EQ(out.burst_count, 0);
  // Half of the tick is before zero: the crossing of 1/2 is half a tick after zero, on the border.
  ASSERT_EQ(generate_steps(profile, -0.25 / 1024, 0, 1, 1e6, kBinary, 0, out), StepError::kNone);
  ASSERT_EQ(out.burst_count, 1);
  EXPECT_EQ(out.bursts[0].first_ticks, 768);
}

TEST(StepGenerator, SlowMotionFarFromTheStart) {
  // One step in 10 s, a million seconds after the last piece; the step is where it belongs to 0.5 us.
  Profile profile;
  ASSERT_TRUE(profile.set(0, 0.1, nullptr, 0));
  const StepTiming timing{1e7, 0.001};
  std::int64_t count = 100000;
  int found = 0;
  for (std::int64_t tick = 1'000'000'000; tick < 1'000'020'000; ++tick) {
    StepCommand out;
    out.position_steps[0] = count;
    const Real t0 = static_cast<Real>(tick) * 0.001;
    ASSERT_EQ(generate_steps(profile, t0, 0, 1, 1e6, timing, 0, out), StepError::kNone);
    for (const Pulse& p : replay(out, 0)) {
      EXPECT_NEAR((t0 - 1e6) + static_cast<Real>(p.timer_tick) / 1e7, 5 + 10 * found, 0.5e-6);
      ++found;
    }
    count = out.position_steps[0];
  }
  EXPECT_EQ(found, 2);
}

TEST(StepGenerator, ErrorsLeaveTheCommandUntouched) {
  const StepTiming timing{1e7, 0.001};
  const auto expect = [&](const Profile& profile, Real scale, Real rate_hz, StepCommand out, StepError error) {
    StepCommand copy = out;
    EXPECT_EQ(generate_steps(profile, 0, 0, scale, rate_hz, timing, 1, out), error);
    EXPECT_EQ(out.steps, copy.steps);
    EXPECT_EQ(out.position_steps, copy.position_steps);
    ASSERT_EQ(out.burst_count, copy.burst_count);
    for (std::size_t b = 0; b < static_cast<std::size_t>(copy.burst_count); ++b) {
      EXPECT_EQ(std::memcmp(&out.bursts[b], &copy.bursts[b], sizeof(StepBurst)), 0);
    }
  };
  Profile profile;
  ASSERT_TRUE(profile.set(0, 1, nullptr, 0));
  StepCommand out;
  out.position_steps[0] = 17;
  out.burst_count = 3;
  expect(profile, 65000, 1e6, out, StepError::kTooManySteps);
  expect(profile, 1e18, 1e6, out, StepError::kTooManySteps);
  expect(profile, 20000, 19999, out, StepError::kTooFast);
  expect(profile, 600, 599, out, StepError::kTooFast);
  out.burst_count = kMaxBursts;
  expect(profile, 20000, 20001, out, StepError::kTooManyBursts);
  out.burst_count = 0;
  out.position_steps[1] = 40;  // not the profile's count: forty steps at once
  expect(profile, 20000, 1e6, out, StepError::kTooFast);
}

TEST(StepGenerator, JustAtTheLimits) {
  const StepTiming timing{1e7, 0.001};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 1, nullptr, 0));
  StepCommand out;
  EXPECT_EQ(generate_steps(profile, 0, 0, 20000, 20000, timing, 1, out), StepError::kNone);
  EXPECT_EQ(out.steps[1], 20);
  EXPECT_EQ(generate_steps(profile, 0, 0, 64000, 64000, timing, 2, out), StepError::kNone);
  EXPECT_EQ(out.steps[2], 64);
}

TEST(StepGenerator, TwoPulsesInOneTimerTickAreTooFast) {
  const StepTiming timing{1e3, 0.02};
  Profile profile;
  ASSERT_TRUE(profile.set(0, 1, nullptr, 0));
  StepCommand out;
  EXPECT_EQ(generate_steps(profile, 0, 0, 1500, 1e6, timing, 0, out), StepError::kTooFast);
}

TEST(StepGenerator, EightMotorsShareTheBursts) {
  const StepTiming timing{1e7, 0.001};
  StepCommand out;
  std::int64_t total = 0;
  for (int motor = 0; motor < kMaxMasses; ++motor) {
    Profile profile;
    const ProfilePiece piece{1, 3.0 * motor, 100};
    ASSERT_TRUE(profile.set(0.1 * motor, motor % 2 == 0 ? 1 : -1, &piece, 1));
    ASSERT_EQ(generate_steps(profile, 0, 0.1 * motor, 3000 + 500 * motor, 1e5, timing, motor, out), StepError::kNone);
    total += std::abs(out.steps[static_cast<std::size_t>(motor)]);
  }
  std::int64_t pulses = 0;
  for (int motor = 0; motor < kMaxMasses; ++motor) pulses += static_cast<std::int64_t>(replay(out, motor).size());
  EXPECT_EQ(pulses, total);
  EXPECT_GT(total, 24);
}

}  // namespace
}  // namespace ballast::firmware
