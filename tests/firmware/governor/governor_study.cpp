// governor_study FIRST LAST: random robots, motions and floors under the governor, one per seed, and the same without
// it. Prints how many left their cone; a range of seeds can be run in pieces. The belief is true and the masses are
// ideal, so with the governor on none may.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <random>

#include "tests/firmware/governed_ball.h"
#include "tests/firmware/governor/bench.h"

namespace ballast::firmware {
namespace {

struct Draw {
  ControllerParams params;
  std::int64_t ticks = 0;
};

// The paper's ball or `desk_ball` with other masses, another start, random pieces of motion, limits and friction.
Draw draw(unsigned seed) {
  std::mt19937_64 random(seed);
  const auto uniform = [&](double least, double most) {
    return std::uniform_real_distribution<double>(least, most)(random);
  };
  const auto vector = [&](double size) {
    return Vector3(uniform(-size, size), uniform(-size, size), uniform(-size, size));
  };
  Draw out;
  ControllerParams& params = out.params;
  params = testing::paper_params();
  const bool desk = uniform(0, 1) < 0.5;
  if (desk) params.ball = testing::desk_bench(1)->ball;
  BallParams& ball = params.ball;
  const double unit_s = std::sqrt(ball.radius_m / ball.gravity_mps2);
  ball.shell_mass_kg *= uniform(0.7, 1.4);
  ball.center_of_mass_B_m += vector(0.03 * ball.radius_m);
  for (std::size_t i = 0; i < 3; ++i) ball.mass_kg[i] *= uniform(0.7, 1.4);
  const Vector3 turn = vector(desk ? 0.3 : 0.1);
  params.estimation.initial_orientation =
      (params.estimation.initial_orientation * Quaternion(1, turn[0] / 2, turn[1] / 2, turn[2] / 2)).normalized();
  params.estimation.initial_angular_velocity_B_radps = vector(uniform(0, 0.3) / unit_s);

  const double speed = uniform(0.1, 0.6) / unit_s, acceleration = speed / (uniform(0.2, 1) * unit_s);
  const double jerk = acceleration / (uniform(0.02, 0.5) * unit_s);
  for (std::size_t i = 0; i < 3; ++i) {
    params.motor[i].max_step_rate_hz = speed * params.motor[i].steps_per_unit;
    params.motor[i].max_acceleration = acceleration;
    params.motor[i].max_jerk = jerk;
    // A push up to a speed and, for some, back to rest.
    const double a = uniform(-0.9, 0.9) * acceleration, s = std::fabs(a) / jerk * uniform(1, 3);
    const double longest = 0.9 * speed / std::fabs(a) - s;
    const double hold = longest > 0 ? uniform(0, longest) : 0, wait = uniform(0, 4) * unit_s;
    const double b = uniform(0, 1) < 0.5 ? a : 0;
    const ProfilePiece pieces[8] = {{wait, 0, 0},       {s, 0, a},  {hold, a, a},   {s, a, 0},
                                    {3 * unit_s, 0, 0}, {s, 0, -b}, {hold, -b, -b}, {s, -b, 0}};
    const double from = desk ? 0 : testing::kPaperStart[i];
    if (longest > 0) static_cast<void>(params.motion[i].set(from, 0, pieces, 8));
    if (!(longest > 0)) static_cast<void>(params.motion[i].set(from, 0, nullptr, 0));
  }
  params.governor.friction = static_cast<Real>(std::exp(uniform(std::log(0.02), std::log(0.4))));
  out.ticks = static_cast<std::int64_t>(15 * unit_s / params.control_period_s);
  return out;
}

}  // namespace
}  // namespace ballast::firmware

int main(int argc, char** argv) {
  using namespace ballast::firmware;
  if (argc != 3) {
    std::fprintf(stderr, "usage: governor_study FIRST LAST\n");
    return 1;
  }
  const long first = std::strtol(argv[1], nullptr, 10), last = std::strtol(argv[2], nullptr, 10);
  int started = 0, refused = 0, broken = 0, broken_without = 0;
  for (long seed = first; seed <= last; ++seed) {
    Draw drawn = draw(static_cast<unsigned>(seed));
    drawn.params.governor.on = true;
    ballast::firmware::testing::GovernedBall governed(drawn.params);
    governed.start();
    if (governed.out.status.mode != Mode::kRunning) {
      ++refused;
      continue;
    }
    ++started;
    governed.run_until(drawn.ticks);
    drawn.params.governor.on = false;
    ballast::firmware::testing::GovernedBall without(drawn.params);
    without.start();
    without.run_until(drawn.ticks);
    if (without.most_use > 1) ++broken_without;
    if (!(governed.most_use > 1)) continue;
    ++broken;
    std::printf("seed %ld: %.6f of the friction in tick %lld, bent by %.3f; without the governor %.6f\n", seed,
                static_cast<double>(governed.most_use), static_cast<long long>(governed.most_use_tick),
                static_cast<double>(governed.largest_bend), static_cast<double>(without.most_use));
  }
  std::printf("%d started, %d refused; left the cone: %d with the governor, %d without\n", started, refused, broken,
              broken_without);
  return broken > 0 ? 1 : 0;
}
