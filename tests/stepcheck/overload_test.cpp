// Random motions of robots whose motors are many or whose timer is coarse, so that a command's bursts do not always
// suffice: what the limits allow is kept in such an overload and in the stop after it.
//   BALLAST_OVERLOAD_MOTIONS=n   per robot (default 150)
//   BALLAST_OVERLOAD_SEED=n
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <random>
#include <vector>

#include "firmware/control/controller.h"
#include "tests/firmware/paper_ball.h"
#include "tools/stepcheck/step_check.h"
#include "tests/firmware/whole_tick.h"

namespace ballast::firmware {
namespace {

std::uint64_t from_environment(const char* name, std::uint64_t otherwise) {
  const char* text = std::getenv(name);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

struct Robot {
  const char* name;
  int motors;
  double timer_frequency_hz;
  double fastest_ticks, slowest_ticks;  // from the step rate to rest, at the greatest acceleration
  bool runs_out;                        // of bursts, in some of its motions
};

constexpr double kPeriod_s = 1e-3;
constexpr double kMostStepsPerTick = 60;

// Circles have no ends. The masses of a motion differ in nothing but its pieces.
ControllerParams params_of(const Robot& robot, std::mt19937_64& random) {
  const auto between = [&random](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  ControllerParams params = testing::paper_params();
  params.timer_frequency_hz = robot.timer_frequency_hz;
  params.control_period_s = kPeriod_s;
  params.ball.mass_count = robot.motors;
  for (int i = 0; i < robot.motors; ++i) {
    const auto m = static_cast<std::size_t>(i);
    params.ball.rail[m] = params.ball.rail[m % 3];
    params.ball.mass_kg[m] = params.ball.mass_kg[m % 3];
    MotorParams& motor = params.motor[m];
    motor.steps_per_unit = random() % 2 == 0 ? 3200 : -3200;
    motor.max_step_rate_hz = kMostStepsPerTick / kPeriod_s;
    motor.direction_setup_s = 2e-6;
    // The acceleration itself comes and goes in a fifth of that time.
    const double top = motor.max_step_rate_hz / 3200;  // rad/s
    motor.max_acceleration =
        top / (kPeriod_s * std::exp(between(std::log(robot.fastest_ticks), std::log(robot.slowest_ticks))));
    motor.max_jerk = motor.max_acceleration / (top / motor.max_acceleration / 5);
    std::vector<ProfilePiece> pieces;
    double v = 0;
    for (int k = 0; k < 12; ++k) {
      const double to = 0.999 * top * between(-1, 1);
      double a = motor.max_acceleration * between(0.1, 0.999) * (to > v ? 1 : -1);
      if (std::fabs(to - v) < a * a / motor.max_jerk) {
        a = std::copysign(0.999 * std::sqrt(std::fabs(to - v) * motor.max_jerk), a);
      }
      const double ramp = 1.001 * std::fabs(a) / motor.max_jerk, flat = std::fmax((to - v) / a - ramp, 0);
      pieces.push_back({ramp, 0, a});
      if (flat > 0) pieces.push_back({flat, a, a});
      pieces.push_back({ramp, a, 0});
      v += a * (ramp + flat);
      pieces.push_back({kPeriod_s * between(0.1, 20), 0, 0});
    }
    EXPECT_TRUE(params.motion[m].set(between(-3, 3), 0, pieces.data(), static_cast<int>(pieces.size())));
  }
  return params;
}

class Overloads : public ::testing::TestWithParam<Robot> {};

TEST_P(Overloads, NoMotorBrakesHarderThanItMay) {
  const Robot robot = GetParam();
  const std::uint64_t seed = from_environment("BALLAST_OVERLOAD_SEED", 20261121);
  const std::uint64_t motions = from_environment("BALLAST_OVERLOAD_MOTIONS", 150);
  RecordProperty("seed", std::to_string(seed));
  std::mt19937_64 random(seed);
  std::uint64_t overloads = 0, running_ticks = 0;
  // Of a pulse without overload, also where bursts are scarce; a fiftieth more, since the motion bends in that time.
  const double tolerance_us = 1.02 * std::fmax(1e6 / robot.timer_frequency_hz, 0.5);
  double worst_microsteps = 0, worst_us = 0;
  int most_bursts = 0;  // in a tick without overload
  for (std::uint64_t motion = 0; motion < motions; ++motion) {
    const auto params = std::make_unique<ControllerParams>(params_of(robot, random));
    ASSERT_TRUE(validate(*params).ok()) << validate(*params).field << ' ' << validate(*params).value;
    const auto state = std::make_unique<ControllerState>();
    reset(*params, *state);
    std::vector<std::unique_ptr<stepcheck::MotorCheck>> checks;
    for (int i = 0; i < robot.motors; ++i) {
      const MotorParams& motor = params->motor[static_cast<std::size_t>(i)];
      // No motion for it: a stop's is not its matter. Distances, ticks and sums are.
      checks.push_back(std::make_unique<stepcheck::MotorCheck>(
          stepcheck::Drive{{}, motor.max_step_rate_hz, motor.direction_setup_s, robot.timer_frequency_hz, kPeriod_s}));
      checks.back()->leave_motion();
    }
    Inputs in;
    Outputs out;
    PerMass<std::int32_t> steps_before{};
    PerMass<Real> velocity_before{};
    PerMass<std::int64_t> count_before{}, count_now{};
    const std::int64_t stop_tick = 3 + static_cast<std::int64_t>(random() % 700);
    bool overloaded = false;
    for (in.tick = 0; in.tick < 5000; ++in.tick) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << ", motion " << motion << ", tick " << in.tick);
      in.sensors.tick = in.monitor.tick = in.tick;
      in.operator_command = in.tick == 0           ? OperatorCommand::kArm
                            : in.tick == 1         ? OperatorCommand::kStart
                            : in.tick == stop_tick ? OperatorCommand::kStop
                                                   : OperatorCommand::kNone;
      whole_tick(*params, *state, in, out);
      running_ticks += out.status.mode == Mode::kRunning ? 1u : 0u;
      if ((out.status.faults & static_cast<std::uint32_t>(Fault::kStepOverload)) != 0) {
        overloaded = true;
        ASSERT_EQ(out.status.mode, Mode::kTripped);
        ASSERT_EQ(out.status.overload.trouble.error, StepError::kTooManyBursts);
        ASSERT_EQ(out.status.overload.trouble.limit, kMaxBursts);
        ASSERT_GE(out.status.overload.motor, 0);
      }
      if (!overloaded) most_bursts = std::max(most_bursts, out.steps.burst_count);
      std::vector<std::vector<stepcheck::Burst>> bursts(static_cast<std::size_t>(robot.motors));
      for (int b = 0; b < out.steps.burst_count; ++b) {
        const StepBurst& burst = out.steps.bursts[static_cast<std::size_t>(b)];
        bursts[burst.motor].push_back(
            {burst.direction, burst.count, burst.first_ticks, burst.interval_ticks, burst.add_ticks});
      }
      for (int i = 0; i < robot.motors; ++i) {
        const auto m = static_cast<std::size_t>(i);
        SCOPED_TRACE(::testing::Message() << "motor " << i);
        const MotorParams& motor = params->motor[m];
        const double microsteps = std::fabs(motor.steps_per_unit);
        // The commanded velocity has no other slack than rounding.
        const double most = motor.max_acceleration * kPeriod_s;
        ASSERT_LE(std::fabs(out.status.commanded_velocity[m] - velocity_before[m]), most * (1 + 1e-6));
        velocity_before[m] = out.status.commanded_velocity[m];
        // Two ticks' pulses are differences of three counts, each within half a microstep of the motion: 1/2 + 1 + 1/2.
        ASSERT_LE(std::abs(out.steps.steps[m] - steps_before[m]), most * kPeriod_s * microsteps + 2);
        steps_before[m] = out.steps.steps[m];
        const auto violation =
            checks[m]->tick(out.steps.tick, bursts[m], out.steps.steps[m], out.steps.position_steps[m]);
        ASSERT_FALSE(violation) << violation->text();
        // The command of two ticks ago ended where this tick's status stands.
        const double x = (out.status.commanded_position[m] - params->motion[m].at(0).position) * motor.steps_per_unit;
        if (in.tick >= 2) {
          ASSERT_LE(std::fabs(x - static_cast<double>(count_before[m])), 0.5 + 1e-6);
        }
        if (!state->moving) continue;
        // How far each pulse is from its place in the motion.
        std::int64_t n = out.steps.position_steps[m] - out.steps.steps[m];
        for (const stepcheck::Burst& burst : bursts[m]) {
          for (std::int64_t j = 0; j < burst.count; ++j, n += burst.direction) {
            const auto added = burst.add * (j * (j - 1) / 2);
            const auto timer_ticks = static_cast<double>(burst.first + j * burst.interval + added);
            const double t = static_cast<double>(out.steps.tick - state->start_tick) * kPeriod_s +
                             timer_ticks / robot.timer_frequency_hz;
            const ProfilePoint p = state->active[m].at(t);
            const double there = (p.position - params->motion[m].at(0).position) * motor.steps_per_unit;
            const double off = std::fabs(there - (static_cast<double>(n) + 0.5 * static_cast<double>(burst.direction)));
            const double rate_hz = std::fabs(p.velocity) * microsteps;
            const double us = rate_hz > 1000 ? 1e6 * off / rate_hz : 0;  // slower ones may turn: touches
            if (!overloaded) {
              ASSERT_LE(us, tolerance_us) << "pulse " << j << " of " << burst.count;
              continue;
            }
            worst_microsteps = std::fmax(worst_microsteps, off);
            worst_us = std::fmax(worst_us, us);
          }
        }
      }
      count_before = count_now;
      count_now = out.steps.position_steps;
      if (in.tick > stop_tick && out.status.at_rest && !state->moving) break;
    }
    overloads += overloaded ? 1 : 0;
    ASSERT_TRUE(out.status.at_rest && !state->moving) << "seed " << seed << ", motion " << motion;
    for (std::size_t m = 0; m < static_cast<std::size_t>(robot.motors); ++m) ASSERT_EQ(out.steps.steps[m], 0);
  }
  std::cout << robot.name << ", seed " << seed << ": " << overloads << " of " << motions << " motions ("
            << running_ticks << " ticks running, at most " << most_bursts << " bursts) overloaded; then pulses at most "
            << worst_microsteps << " microsteps off, " << worst_us << " us above 1000 steps/s\n";
  if (motions >= 150) {  // fewer may happen to have none
    EXPECT_EQ(overloads > 0, robot.runs_out);
  }
  // Shared by eight, four bursts of 16 pulses: rounded to whole timer ticks, with parabola and straight line each off
  // by half a tick, such a one strays by 0.5 15^2 / 8 + 0.5 15 / 2 = 18 ticks at most; at 1 MHz and 60 steps a tick
  // that is 1.1 microsteps. And the bend of a stop in the time of such a burst, which is less than rounding.
  EXPECT_LE(worst_microsteps, 1.2);
}

INSTANTIATE_TEST_SUITE_P(Robots, Overloads,
                         ::testing::Values(Robot{"EightMotorsAt10MHz", 8, 1e7, 5, 200, false},
                                           Robot{"EightWildMotorsAt10MHz", 8, 1e7, 3, 6, true},
                                           Robot{"EightMotorsAt1MHz", 8, 1e6, 5, 200, true},
                                           Robot{"ThreeMotorsAt1MHz", 3, 1e6, 5, 200, true},
                                           Robot{"ThreeMotorsAt10MHz", 3, 1e7, 3, 6, false}),
                         [](const auto& robot) { return robot.param.name; });

}  // namespace
}  // namespace ballast::firmware
