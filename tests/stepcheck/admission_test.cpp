// Random motions of 1 to 8 motors at the greatest step rate that validate() admits: none may overload, neither while it
// runs nor in a stop out of it, and every pulse has to be where the checker wants it.
//   BALLAST_ADMISSION_MOTIONS=n   per number of motors (default 120)
//   BALLAST_SEED=n
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <random>
#include <vector>

#include "firmware/control/controller.h"
#include "tests/firmware/paper_ball.h"
#include "tests/firmware/whole_tick.h"
#include "tests/random_seed.h"
#include "tools/stepcheck/step_check.h"

namespace ballast::firmware {
namespace {

std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

class RandomRobot {
 public:
  RandomRobot(int motors, std::mt19937_64& random) : motors_(motors), random_(random) {}

  // Motions that validate() admits: what it refuses is drawn again. On circles, which have no ends.
  void draw(ControllerParams& params) {
    params = testing::paper_params();
    params.timer_frequency_hz = one_of({1e6, 1e6, 2.5e6, 1e7, 1.6e7, 1e8});
    params.control_period_s = one_of({1e-3, 1e-3, 1e-4, 1e-2});
    params.ball.mass_count = motors_;
    most_hz_ = (sure_steps_per_tick(motors_) - 1) / params.control_period_s;
    for (std::size_t i = 0; i < static_cast<std::size_t>(motors_); ++i) {
      params.ball.rail[i] = testing::paper_ball().rail[i % 3];
      params.ball.mass_kg[i] = 1;
      draw_motor(params, i);
    }
    for (ParamError error = validate(params); !error.ok(); error = validate(params)) {
      ASSERT_GE(error.piece + error.limit, 0) << error.field << " is none of the motion";
      draw_motor(params, static_cast<std::size_t>(error.index));
      ++refused;
    }
  }

  int refused = 0;

 private:
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  double log_between(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  double one_of(std::initializer_list<double> values) { return values.begin()[random_() % values.size()]; }

  void draw_motor(ControllerParams& params, std::size_t i) {
    const double period_s = params.control_period_s;
    MotorParams& motor = params.motor[i];
    motor.steps_per_unit = one_of({3200, -3200});
    motor.max_step_rate_hz = one_of({1, 1, 0.6}) * most_hz_;
    motor.direction_setup_s = one_of({0, 2e-7, 2e-6, 2e-5}) * period_s / 1e-3;
    const double top = motor.max_step_rate_hz / 3200;  // rad/s
    // From the step rate to rest in half a tick to 200 ticks; the acceleration comes and goes in a fifth of that time
    // or in far less.
    const double ticks_to_rest = log_between(0.5, 200);
    motor.max_acceleration = top / (period_s * ticks_to_rest);
    motor.max_jerk = motor.max_acceleration / (period_s * ticks_to_rest * one_of({0.2, 0.01}));
    std::vector<ProfilePiece> pieces;
    switch (random_() % 3) {
      case 0:
        s_curves(motor, top, period_s, pieces);
        break;
      case 1:
        kinks(motor, top, period_s, pieces);
        break;
      default:
        to_and_fro(motor, top, period_s, pieces);
        break;
    }
    EXPECT_TRUE(params.motion[i].set(between(-3, 3), start_, pieces.data(), static_cast<int>(pieces.size())));
  }

  // From velocity to velocity with ramps of acceleration, and stretches at exactly the step rate.
  void s_curves(const MotorParams& motor, double top, double period_s, std::vector<ProfilePiece>& pieces) {
    double v = start_ = 0;
    for (int k = 0; k < 12; ++k) {
      const double to = (random_() % 3 == 0 ? 1 - 1e-12 : between(0, 0.999)) * top * one_of({1, -1});
      if (std::fabs(to - v) < 1e-6 * top) continue;
      double a = motor.max_acceleration * between(0.1, 0.999) * (to > v ? 1 : -1);
      if (std::fabs(to - v) < a * a / motor.max_jerk) {
        a = std::copysign(0.999 * std::sqrt(std::fabs(to - v) * motor.max_jerk), a);
      }
      const double ramp = 1.001 * std::fabs(a) / motor.max_jerk, flat = std::fmax((to - v) / a - ramp, 0);
      pieces.push_back({ramp, 0, a});
      if (flat > 0) pieces.push_back({flat, a, a});
      pieces.push_back({ramp, a, 0});
      v += a * (ramp + flat);
      pieces.push_back({period_s * between(0.1, 20), 0, 0});
    }
  }

  // Many short pieces whose accelerations jump as they please, within the limits.
  void kinks(const MotorParams& motor, double top, double period_s, std::vector<ProfilePiece>& pieces) {
    double v = start_ = top * between(-1, 1);
    for (int k = 0; k < kMaxPieces; ++k) {
      const double duration = period_s * log_between(0.02, 2);
      const double low = std::fmax(-motor.max_acceleration, (-top - v) / duration);
      const double high = std::fmin(motor.max_acceleration, (top - v) / duration);
      const double a = between(low, high) * (1 - 1e-9);
      pieces.push_back({duration, a, a});
      v += a * duration;
    }
  }

  // Reversals in quick succession.
  void to_and_fro(const MotorParams& motor, double top, double period_s, std::vector<ProfilePiece>& pieces) {
    const double a = motor.max_acceleration * between(0.2, 0.999);
    const double longest = 2 * top / a;
    double v = start_ = 0;
    double sign = 1;
    for (int k = 0; k < kMaxPieces; ++k, sign = -sign) {
      // To the other side of rest by about as much as it is on this side.
      double to = sign * top * log_between(1e-3, 0.999);
      double duration = std::fabs(to - v) / a;
      if (duration < 1e-3 * period_s) duration = std::fmin(1e-3 * period_s, longest);
      pieces.push_back({duration, sign * a, sign * a});
      v += sign * a * duration;
    }
  }

  int motors_;
  std::mt19937_64& random_;
  double most_hz_ = 0;
  double start_ = 0;  // initial velocity of the motion drawn last
};

stepcheck::Motion motion_of(const ControllerParams& params, std::size_t m) {
  const Profile& profile = params.motion[m];
  stepcheck::Motion motion;
  motion.position = profile.at(0).position;
  motion.velocity = profile.at(0).velocity;
  motion.microsteps_per_unit = params.motor[m].steps_per_unit;
  for (int p = 0; p < profile.piece_count(); ++p) {
    const Cubic& c = profile.cubic(p);
    motion.pieces.push_back({c.duration_s, c.acceleration, c.acceleration + c.jerk * c.duration_s});
  }
  return motion;
}

class Admitted : public ::testing::TestWithParam<int> {};

TEST_P(Admitted, NoMotionRunsOutOfBursts) {
  const int motors = GetParam();
  const std::uint64_t seed = ballast::test::random_seed(20261122);
  const std::uint64_t motions = from_environment("BALLAST_ADMISSION_MOTIONS", 120);
  RecordProperty("seed", std::to_string(seed));
  std::mt19937_64 random(seed + static_cast<std::uint64_t>(motors));
  RandomRobot robot(motors, random);
  const auto params = std::make_unique<ControllerParams>();
  const auto state = std::make_unique<ControllerState>();
  std::int64_t ticks = 0, pulses = 0;
  int most_bursts = 0;  // of one motor in one tick
  for (std::uint64_t motion = 0; motion < motions; ++motion) {
    robot.draw(*params);
    reset(*params, *state);
    std::vector<std::unique_ptr<stepcheck::MotorCheck>> checks;
    for (std::size_t m = 0; m < static_cast<std::size_t>(motors); ++m) {
      const MotorParams& motor = params->motor[m];
      checks.push_back(std::make_unique<stepcheck::MotorCheck>(stepcheck::Drive{
          motion_of(*params, m), static_cast<double>(motor.max_step_rate_hz),
          static_cast<double>(motor.direction_setup_s), static_cast<double>(params->timer_frequency_hz),
          static_cast<double>(params->control_period_s)}));
    }
    Inputs in;
    Outputs out;
    const std::int64_t stop_tick = 3 + static_cast<std::int64_t>(random() % 300);
    for (in.tick = 0; in.tick < 5000; ++in.tick) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << ", motion " << motion << ", tick " << in.tick);
      in.sensors.tick = in.monitor.tick = in.tick;
      in.operator_command = in.tick == 0           ? OperatorCommand::kArm
                            : in.tick == 1         ? OperatorCommand::kStart
                            : in.tick == stop_tick ? OperatorCommand::kStop
                                                   : OperatorCommand::kNone;
      whole_tick(*params, *state, in, out);
      ++ticks;
      ASSERT_EQ(out.status.faults, 0u) << "motor " << out.status.overload.motor << ": error "
                                       << static_cast<int>(out.status.overload.trouble.error) << ", "
                                       << out.status.overload.trouble.value << ", limit "
                                       << out.status.overload.trouble.limit;
      std::vector<std::vector<stepcheck::Burst>> bursts(static_cast<std::size_t>(motors));
      for (int b = 0; b < out.steps.burst_count; ++b) {
        const StepBurst& burst = out.steps.bursts[static_cast<std::size_t>(b)];
        bursts[burst.motor].push_back(
            {burst.direction, burst.count, burst.first_ticks, burst.interval_ticks, burst.add_ticks});
        pulses += burst.count;
      }
      // The motion begins in the second command: that of tick 2.
      for (std::size_t m = 0; in.tick >= 1 && m < static_cast<std::size_t>(motors); ++m) {
        most_bursts = std::max(most_bursts, static_cast<int>(bursts[m].size()));
        // The stop is held against its rules only.
        if (in.tick == stop_tick) checks[m]->leave_motion();
        const auto violation =
            checks[m]->tick(out.steps.tick - 2, bursts[m], out.steps.steps[m], out.steps.position_steps[m]);
        ASSERT_FALSE(violation) << "motor " << m << ": " << violation->text();
      }
      if (in.tick > stop_tick && out.status.at_rest && !state->moving) break;
    }
    ASSERT_TRUE(out.status.at_rest && !state->moving) << "seed " << seed << ", motion " << motion;
  }
  EXPECT_LE(most_bursts, bursts_per_motor(motors));
  EXPECT_GT(pulses, ticks) << "without steps nothing is proved";
  std::cout << motors << " motors, seed " << seed << ": " << motions << " motions, " << robot.refused
            << " refused before, " << ticks << " ticks, " << pulses << " pulses, at most " << most_bursts << " of "
            << bursts_per_motor(motors) << " bursts\n";
}

INSTANTIATE_TEST_SUITE_P(Motors, Admitted, ::testing::Range(1, kMaxMasses + 1));

}  // namespace
}  // namespace ballast::firmware
