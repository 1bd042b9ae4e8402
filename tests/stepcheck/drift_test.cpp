// A day of to and fro: the count never leaves the motion by more than half a microstep.
//   BALLAST_STEPCHECK_HOURS=n   simulated hours in ticks of 1/128 s (default 24, which take some seconds)
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <iostream>

#include "firmware/motion/step_generator.h"

namespace ballast::firmware {
namespace {

using Exact = __int128;

// One period of to and fro lasts 2^k s and repeats for ever: the profile has 128 pieces, and is begun again at their
// end from where it stands, as a controller does. Durations, accelerations and the scale are binary fractions, so the
// position in microsteps at every control tick is a whole number of 2^-40 microsteps, and integers know it exactly.
TEST(Drift, ADayOfToAndFro) {
  const char* text = std::getenv("BALLAST_STEPCHECK_HOURS");
  const double hours = text == nullptr ? 24 : std::strtod(text, nullptr);
  // Ticks of 1/128 s. A stroke: 2 s of acceleration +a, 4 s of -a, 2 s of +a; it comes back to rest 8 s later, shifted
  // by 0 in velocity and back in position. x''= a: |x| up to 4 a.
  constexpr Real kPeriod = 1.0 / 128;
  constexpr std::int64_t kPerSecond = 128;
  constexpr Real a = 0.8125;          // rad/s^2
  constexpr Real scale = 509.296875;  // microsteps per rad, 3200 / (2 pi) cut to a binary fraction
  const StepTiming timing{16777216, kPeriod, 2.0 / 16777216};
  ProfilePiece pieces[126];
  for (int i = 0; i < 126; i += 3) {
    const Real sign = i % 2 == 0 ? 1 : -1;
    pieces[i] = {2, sign * a, sign * a};
    pieces[i + 1] = {4, -sign * a, -sign * a};
    pieces[i + 2] = {2, sign * a, sign * a};
  }
  Profile profile;
  ASSERT_TRUE(profile.set(0.25, 0, pieces, 126));
  constexpr std::int64_t kTicksPerProfile = std::int64_t{42} * 8 * kPerSecond;
  // a scale, in 2^-12 microsteps / s^2; times in 2^-7 s; so x in 2^-12 2^-14 / 2 microsteps
  constexpr auto kAcceleration = static_cast<std::int64_t>(a * scale * 4096);
  static_assert(static_cast<Real>(kAcceleration) == a * scale * 4096);

  const auto ticks = static_cast<std::int64_t>(hours * 3600 * kPerSecond);
  StepCommand out;
  std::int64_t pulses = 0, on_level = 0;
  Exact twice_x = 0, v = 0;  // 2 x in 2^-26 microsteps, at the tick's end
  std::int64_t worst = 0;    // |2 x - 2 n| in 2^-26
  for (std::int64_t tick = 0; tick < ticks; ++tick) {
    const std::int64_t inside = tick % kTicksPerProfile;
    out.tick = tick;
    out.burst_count = 0;
    const std::int64_t before = out.position_steps[0];
    ASSERT_EQ(generate_steps(profile, static_cast<Real>(inside) * kPeriod, 0.25, scale, 60000, timing, 0, out),
              StepError::kNone)
        << "tick " << tick;
    for (int b = 0; b < out.burst_count; ++b) pulses += out.bursts[static_cast<std::size_t>(b)].count;

    // x(t + 1) = x + v + a/2 with times in ticks; the acceleration in force over this tick.
    const std::int64_t in_stroke = inside % (8 * kPerSecond), stroke = inside / (8 * kPerSecond);
    const bool forward = in_stroke < 2 * kPerSecond || in_stroke >= 6 * kPerSecond;
    const Exact acceleration = (forward == (stroke % 2 == 0) ? 1 : -1) * Exact{kAcceleration};
    twice_x += 2 * v + acceleration;
    v += acceleration;
    const Exact off = twice_x - (Exact{out.position_steps[0]} << 27);
    const auto distance = static_cast<std::int64_t>(off < 0 ? -off : off);
    ASSERT_LE(distance, std::int64_t{1} << 26) << "more than half a microstep off at the end of tick " << tick
                                               << ", count " << before << " to " << out.position_steps[0];
    worst = std::max(worst, distance);
    on_level += distance == std::int64_t{1} << 26 ? 1 : 0;
  }
  EXPECT_GT(pulses, ticks);
  EXPECT_GT(worst, (std::int64_t{1} << 26) * 99 / 100) << "it does come close to half a microstep";
  std::cout << hours << " h: " << ticks << " ticks, " << pulses << " steps, count at the end " << out.position_steps[0]
            << ", farthest from the motion " << static_cast<double>(worst) / (1 << 27) << " microsteps, " << on_level
            << " times exactly half-way\n";
}

}  // namespace
}  // namespace ballast::firmware
