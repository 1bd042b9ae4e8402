#include "firmware/control/controller.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "tests/firmware/paper_ball.h"

namespace ballast::firmware {
namespace {

constexpr std::uint32_t bit(Fault fault) { return static_cast<std::uint32_t>(fault); }

// A robot on the bench: healthy sensors and heartbeat every tick unless a test spoils them.
class Bench {
 public:
  explicit Bench(const ControllerParams& params = testing::paper_params())
      : params_(std::make_unique<ControllerParams>(params)), state_(std::make_unique<ControllerState>()) {
    const ParamError error = validate(*params_);
    EXPECT_TRUE(error.ok()) << error.field;
    reset(*params_, *state_);
  }

  // Serves one tick; what happened to the count is checked against the profile the status reports.
  const Outputs& tick(OperatorCommand command = OperatorCommand::kNone) {
    if (sensors_alive) in.sensors.tick = in.tick;
    if (monitor_alive) in.monitor.tick = in.tick - 1;
    in.operator_command = command;
    const PerMass<std::int64_t> before = state_->position_steps;
    firmware::tick(*params_, *state_, in, out);
    EXPECT_EQ(out.steps.tick, in.tick + 1);
    EXPECT_EQ(out.steps.motor_count, params_->ball.mass_count);
    EXPECT_EQ(out.status.tick, in.tick);
    EXPECT_EQ(out.status.scenario_id, params_->scenario_id);
    EXPECT_EQ(out.status.mode, state_->mode);
    PerMass<std::int64_t> pulses{};
    for (int b = 0; b < out.steps.burst_count; ++b) {
      const StepBurst& burst = out.steps.bursts[static_cast<std::size_t>(b)];
      pulses[burst.motor] += burst.direction * burst.count;
    }
    for (std::size_t i = 0; i < kMaxMasses; ++i) {
      EXPECT_EQ(out.steps.position_steps[i], before[i] + out.steps.steps[i]);
      EXPECT_EQ(out.steps.steps[i], pulses[i]);
    }
    ++in.tick;
    return out;
  }

  void run(int ticks) {
    for (int k = 0; k < ticks; ++k) tick();
  }

  void arm_and_start() {
    tick(OperatorCommand::kArm);
    EXPECT_EQ(out.status.mode, Mode::kArmed);
    tick(OperatorCommand::kStart);
    EXPECT_EQ(out.status.mode, Mode::kRunning);
  }

  // The rule of step_generator.h: after tick k's command, the count is the nearest to the profile at the start of tick
  // k + 2, which is what the status of tick k + 2 reports. So compare a command with the status two ticks later.
  void expect_counts_follow_status(int ticks) {
    std::vector<PerMass<std::int64_t>> counts;
    for (int k = 0; k < ticks; ++k) {
      tick();
      counts.push_back(out.steps.position_steps);
      if (k < 2) continue;
      for (int i = 0; i < params_->ball.mass_count; ++i) {
        const auto m = static_cast<std::size_t>(i);
        const Real x =
            (out.status.commanded_position[m] - params_->motion[m].at(0).position) * params_->motor[m].steps_per_unit;
        ASSERT_LE(std::fabs(x - static_cast<Real>(counts[static_cast<std::size_t>(k - 2)][m])), 0.5 + 1e-9)
            << "motor " << i << " tick " << in.tick - 1;
      }
    }
  }

  Inputs in;
  Outputs out;
  bool sensors_alive = true, monitor_alive = true;
  [[nodiscard]] const ControllerParams& params() const { return *params_; }
  [[nodiscard]] const ControllerState& state() const { return *state_; }

 private:
  std::unique_ptr<ControllerParams> params_;
  std::unique_ptr<ControllerState> state_;
};

// From now until the masses hold, they decelerate at max_acceleration and no faster; then they stay.
void expect_braking_then_holding(Bench& bench) {
  const Real period = bench.params().control_period_s;
  PerMass<Real> velocity = bench.out.status.commanded_velocity, position{};
  bool rested = false;
  for (int k = 0; k < 3000; ++k) {
    bench.tick();
    for (std::size_t i = 0; i < 3; ++i) {
      const Real v = bench.out.status.commanded_velocity[i];
      // The first of these ticks is still the motion's, whose acceleration is at most 1 < 2.
      ASSERT_LE(std::fabs(v - velocity[i]), (bench.params().motor[i].max_acceleration + 1e-9) * period) << "tick " << k;
      if (k > 1) {
        ASSERT_LE(std::fabs(v), std::fabs(velocity[i])) << "never speeds up";
      }
      velocity[i] = v;
    }
    if (rested) {
      ASSERT_EQ(bench.out.status.commanded_position, position) << "holds";
      ASSERT_EQ(bench.out.steps.burst_count, 0);
      for (std::size_t i = 0; i < 3; ++i) ASSERT_EQ(velocity[i], 0);
    }
    if (bench.out.status.at_rest && !rested) {
      rested = true;
      bench.tick();
      position = bench.out.status.commanded_position;
      velocity = bench.out.status.commanded_velocity;
    }
  }
  EXPECT_TRUE(rested);
}

TEST(Controller, StartsDisarmedAndHoldsStill) {
  Bench bench;
  bench.run(10);
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed);
  EXPECT_TRUE(bench.out.status.at_rest);
  EXPECT_EQ(bench.out.status.faults, 0u);
  EXPECT_EQ(bench.out.steps.burst_count, 0);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(bench.out.status.commanded_position[i], testing::kPaperStart[i]);
  bench.tick(OperatorCommand::kStart);
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed) << "start before arm is ignored";
  bench.tick(static_cast<OperatorCommand>(77));
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed) << "an unknown command is ignored";
}

TEST(Controller, RunsThePaperMotionFromTheTickAfterStart) {
  Bench bench;
  bench.in.tick = -2;
  bench.tick(OperatorCommand::kArm);
  bench.tick(OperatorCommand::kStart);  // tick -1
  EXPECT_EQ(bench.out.status.mode, Mode::kRunning);
  EXPECT_EQ(bench.out.status.commanded_velocity[0], 0);
  for (int k = 0; k <= 300; ++k) {
    bench.tick();
    const Real t = k * 0.001;
    // eq_prescribed_u_ball integrated twice.
    Real p = t * t / 2, v = t;
    if (t > 0.1) {
      const Real s = std::fmin(t, 0.2) - 0.1;
      v = 0.1 + s - 5 * s * s;
      p = 0.005 + 0.1 * s + s * s / 2 - 5 * s * s * s / 3;
    }
    if (t > 0.2) p += 0.15 * (t - 0.2);
    for (std::size_t i = 0; i < 3; ++i) {
      ASSERT_NEAR(bench.out.status.commanded_position[i], testing::kPaperStart[i] + p, 1e-15 * 8) << "t = " << t;
      ASSERT_NEAR(bench.out.status.commanded_velocity[i], v, 1e-15) << "t = " << t;
    }
  }
  EXPECT_EQ(bench.out.status.mode, Mode::kRunning);
  EXPECT_FALSE(bench.out.status.at_rest);
  EXPECT_GT(bench.out.status.steps_issued[0], 0);
  EXPECT_EQ(bench.out.status.steps_issued[0], bench.out.steps.position_steps[0]) << "all in one direction";
  EXPECT_EQ(bench.out.status.steps_issued[3], 0);
}

TEST(Controller, CountsFollowTheProfileThroughRunStopAndRest) {
  Bench bench;
  bench.arm_and_start();
  bench.expect_counts_follow_status(2000);
  bench.tick(OperatorCommand::kStop);
  EXPECT_EQ(bench.out.status.mode, Mode::kStopping);
  bench.expect_counts_follow_status(500);
  EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
}

TEST(Controller, NegativeWiringCountsDown) {
  ControllerParams params = testing::paper_params();
  params.motor[1].steps_per_unit *= -1;
  Bench bench(params);
  bench.arm_and_start();
  bench.expect_counts_follow_status(1000);
  EXPECT_LT(bench.out.steps.position_steps[1], 0);
  EXPECT_EQ(bench.out.status.steps_issued[1], -bench.out.steps.position_steps[1]);
}

TEST(Controller, StopBrakesRestsAndArms) {
  Bench bench;
  bench.arm_and_start();
  bench.run(500);
  EXPECT_NEAR(bench.out.status.commanded_velocity[0], 0.15, 1e-12);
  bench.tick(OperatorCommand::kStop);
  EXPECT_EQ(bench.out.status.mode, Mode::kStopping);
  EXPECT_NEAR(bench.out.status.commanded_velocity[0], 0.15, 1e-12) << "the stop begins with the next tick";
  bench.tick();
  EXPECT_NEAR(bench.out.status.commanded_velocity[0], 0.15, 1e-12);
  bench.tick();
  EXPECT_NEAR(bench.out.status.commanded_velocity[0], 0.15 - 2 * 0.001, 1e-12);
  const Real before = bench.out.status.commanded_position[0];
  // 0.15 / 2 = 75 ms of braking; two of them are over.
  int ticks = 0;
  while (bench.out.status.mode == Mode::kStopping && ticks < 1000) {
    EXPECT_FALSE(bench.out.status.at_rest);
    bench.tick();
    ++ticks;
  }
  EXPECT_NEAR(ticks, 73, 1);
  EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
  EXPECT_TRUE(bench.out.status.at_rest);
  bench.run(2);
  EXPECT_EQ(bench.out.status.commanded_velocity[0], 0);
  // v^2 / 2a from the point one tick into the stop.
  EXPECT_NEAR(bench.out.status.commanded_position[0] - before, 0.148 * 0.148 / 4, 1e-12);
  bench.tick(OperatorCommand::kStop);
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed) << "stop while armed disarms";
}

TEST(Controller, StartAfterAStopRunsTheSameShapeFromWhereTheMassesStand) {
  ControllerParams params = testing::paper_params();
  ASSERT_TRUE(params.motion[0].set(0, 0.3, testing::kPaperMotion, 2));
  Bench bench(params);
  bench.arm_and_start();
  bench.tick();
  EXPECT_EQ(bench.out.status.commanded_velocity[0], 0.3) << "the first start is as the scenario says";
  bench.run(300);
  bench.tick(OperatorCommand::kStop);
  bench.run(500);
  ASSERT_EQ(bench.out.status.mode, Mode::kArmed);
  const PerMass<Real> stands = bench.out.status.commanded_position;
  EXPECT_GT(stands[0], 0.05);
  bench.tick(OperatorCommand::kStart);
  ASSERT_EQ(bench.out.status.mode, Mode::kRunning);
  bench.tick();
  EXPECT_EQ(bench.out.status.commanded_position, stands) << "no jump";
  EXPECT_EQ(bench.out.status.commanded_velocity[0], 0);
  bench.expect_counts_follow_status(300);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(bench.out.status.commanded_velocity[i], 0.15, 1e-12);
}

TEST(Controller, AMotionThatEndsAtRestLeavesTheModeRunning) {
  ControllerParams params = testing::paper_params();
  const ProfilePiece there_and_rest[] = {{0.1, 1, 1}, {0.1, -1, -1}};
  for (std::size_t i = 0; i < 3; ++i) ASSERT_TRUE(params.motion[i].set(0, 0, there_and_rest, 2));
  Bench bench(params);
  bench.arm_and_start();
  bench.run(150);
  EXPECT_FALSE(bench.out.status.at_rest);
  bench.run(300);
  EXPECT_TRUE(bench.out.status.at_rest);
  EXPECT_EQ(bench.out.status.mode, Mode::kRunning);
  bench.tick(OperatorCommand::kStop);
  EXPECT_EQ(bench.out.status.mode, Mode::kArmed) << "nothing left to brake";
}

TEST(Controller, ArmingNeedsSensorsAndHeartbeat) {
  Bench bench;
  bench.sensors_alive = bench.monitor_alive = false;
  bench.in.tick = 0;
  bench.tick(OperatorCommand::kArm);
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed) << "what never came is stale, also in tick 0";
  EXPECT_EQ(bench.out.status.faults, bit(Fault::kSensorStale) | bit(Fault::kMonitorStale));
  bench.sensors_alive = true;
  bench.tick(OperatorCommand::kArm);
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed);
  EXPECT_EQ(bench.out.status.faults, bit(Fault::kMonitorStale));
  bench.monitor_alive = true;
  bench.tick(OperatorCommand::kArm);
  EXPECT_EQ(bench.out.status.mode, Mode::kArmed) << "while disarmed faults do not latch";
  EXPECT_EQ(bench.out.status.faults, 0u);
}

TEST(Controller, StaleSensorsTripAfterTheStatedTicks) {
  for (const bool sensors : {true, false}) {
    Bench bench;
    bench.arm_and_start();
    bench.run(500);
    (sensors ? bench.sensors_alive : bench.monitor_alive) = false;
    // The heartbeat is one tick old when it comes.
    const int allowed = sensors ? bench.params().sensor_stale_ticks : bench.params().monitor_stale_ticks - 1;
    bench.run(allowed);
    EXPECT_EQ(bench.out.status.mode, Mode::kRunning);
    bench.tick();
    EXPECT_EQ(bench.out.status.mode, Mode::kTripped);
    EXPECT_EQ(bench.out.status.faults, bit(sensors ? Fault::kSensorStale : Fault::kMonitorStale));
    expect_braking_then_holding(bench);
  }
}

TEST(Controller, SensorsFromTheFutureAreStale) {
  Bench bench;
  bench.arm_and_start();
  bench.sensors_alive = false;
  bench.in.sensors.tick = bench.in.tick + 1;
  bench.tick();
  EXPECT_EQ(bench.out.status.faults, bit(Fault::kSensorStale));
}

TEST(Controller, BadSensorsTrip) {
  constexpr Real kNan = std::numeric_limits<Real>::quiet_NaN();
  const Quaternion bad_attitudes[] = {Quaternion(kNan, 0, 0, 0),
                                      Quaternion(1, 0, std::numeric_limits<Real>::infinity(), 0),
                                      Quaternion(0, 0, 0, 0), Quaternion(1.0011, 0, 0, 0), Quaternion(0.9989, 0, 0, 0)};
  for (int kind = 0; kind < 7; ++kind) {
    Bench bench;
    bench.arm_and_start();
    bench.run(400);
    if (kind < 5) bench.in.sensors.orientation = bad_attitudes[kind];
    if (kind == 5) bench.in.sensors.gyro_B_radps[1] = kNan;
    if (kind == 6) bench.in.sensors.accelerometer_B_mps2[2] = -std::numeric_limits<Real>::infinity();
    bench.tick();
    EXPECT_EQ(bench.out.status.mode, Mode::kTripped) << kind;
    EXPECT_EQ(bench.out.status.faults, bit(Fault::kSensorNotFinite)) << kind;
    EXPECT_TRUE(std::isnan(bench.out.status.predicted.normal_force_n)) << kind;
    EXPECT_EQ(bench.out.status.mu_required, std::numeric_limits<Real>::infinity());
    EXPECT_EQ(bench.out.status.margin, -1);
    bench.in.sensors = Sensors{};
    expect_braking_then_holding(bench);
    EXPECT_EQ(bench.out.status.mode, Mode::kTripped) << "one bad sample latches";
  }
}

TEST(Controller, ASlightlyLongQuaternionIsNormalised) {
  Bench one, other;
  const Quaternion q = Quaternion(0.9, 0.1, -0.3, 0.2).normalized();
  one.in.sensors.orientation = q;
  other.in.sensors.orientation.coeffs() = q.coeffs() * 1.0009;
  one.arm_and_start();
  other.arm_and_start();
  EXPECT_EQ(other.out.status.faults, 0u);
  EXPECT_NEAR(other.out.status.predicted.normal_force_n, one.out.status.predicted.normal_force_n, 1e-14);
}

TEST(Controller, MonitorTripLatchesUntilItIsGoneAndTheMassesRest) {
  Bench bench;
  bench.arm_and_start();
  bench.run(500);
  bench.in.monitor.tripped = true;
  bench.tick();
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped);
  EXPECT_EQ(bench.out.status.faults, bit(Fault::kMonitorTrip));
  bench.in.monitor.tripped = false;
  bench.tick(OperatorCommand::kReset);
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped) << "still moving";
  for (const OperatorCommand c : {OperatorCommand::kArm, OperatorCommand::kStart, OperatorCommand::kStop}) {
    bench.tick(c);
    EXPECT_EQ(bench.out.status.mode, Mode::kTripped) << "latched";
  }
  expect_braking_then_holding(bench);
  bench.in.monitor.tripped = true;
  bench.tick(OperatorCommand::kReset);
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped) << "the cause is still there";
  bench.in.monitor.tripped = false;
  bench.tick();
  EXPECT_EQ(bench.out.status.faults, bit(Fault::kMonitorTrip)) << "faults latch too";
  bench.tick(OperatorCommand::kReset);
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed);
  EXPECT_EQ(bench.out.status.faults, 0u);
  bench.arm_and_start();
  bench.expect_counts_follow_status(300);
  EXPECT_NEAR(bench.out.status.commanded_velocity[2], 0.15, 1e-12) << "runs again, from where it stood";
}

TEST(Controller, ATripWhileStoppingOrArmed) {
  Bench armed;
  armed.tick(OperatorCommand::kArm);
  armed.in.monitor.tripped = true;
  armed.tick(OperatorCommand::kStart);
  EXPECT_EQ(armed.out.status.mode, Mode::kTripped) << "the fault is stronger than the operator";
  EXPECT_TRUE(armed.out.status.at_rest);
  armed.in.monitor.tripped = false;
  armed.tick(OperatorCommand::kReset);
  EXPECT_EQ(armed.out.status.mode, Mode::kDisarmed);

  Bench stopping;
  stopping.arm_and_start();
  stopping.run(500);
  stopping.tick(OperatorCommand::kStop);
  stopping.run(20);
  stopping.in.monitor.tripped = true;
  stopping.tick();
  EXPECT_EQ(stopping.out.status.mode, Mode::kTripped);
  expect_braking_then_holding(stopping);
}

TEST(Controller, ARepeatedTickIssuesNothingTwice) {
  Bench bench;
  bench.arm_and_start();
  bench.run(500);
  const PerMass<std::int64_t> counts = bench.out.steps.position_steps;
  const PerMass<Real> before = bench.out.status.commanded_position;
  --bench.in.tick;
  bench.tick();
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped);
  EXPECT_EQ(bench.out.status.faults, bit(Fault::kTickOutOfOrder));
  EXPECT_EQ(bench.out.steps.burst_count, 0);
  EXPECT_EQ(bench.out.steps.position_steps, counts);
  EXPECT_EQ(bench.out.status.commanded_position, before);
  bench.expect_counts_follow_status(500);
  EXPECT_TRUE(bench.out.status.at_rest);
  bench.tick(OperatorCommand::kReset);
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed);
}

TEST(Controller, AfterARepeatedTickTheMassesBrake) {
  Bench bench;
  bench.arm_and_start();
  bench.run(500);
  const std::int64_t last = bench.out.steps.tick;  // its steps are on their way
  --bench.in.tick;
  bench.tick();
  bench.tick();
  EXPECT_EQ(bench.out.status.tick, last);
  EXPECT_NEAR(bench.out.status.commanded_velocity[0], 0.15, 1e-12);
  bench.tick();
  EXPECT_NEAR(bench.out.status.commanded_velocity[0], 0.15, 1e-12) << "the stop begins where the issued steps end";
  bench.tick();
  EXPECT_NEAR(bench.out.status.commanded_velocity[0], 0.15 - 2 * 0.001, 1e-12);
  expect_braking_then_holding(bench);
}

TEST(Controller, ASkippedOrPastTickHoldsWhereTheMotorsStand) {
  for (const std::int64_t jump : {1L, 7L, 1000000L, -5L, -100L}) {
    Bench bench;
    bench.arm_and_start();
    bench.run(500);
    const PerMass<std::int64_t> counts = bench.out.steps.position_steps;
    bench.in.tick += jump;
    bench.tick();
    EXPECT_EQ(bench.out.status.mode, Mode::kTripped) << jump;
    EXPECT_EQ(bench.out.status.faults, bit(Fault::kTickOutOfOrder)) << jump;
    EXPECT_EQ(bench.out.steps.burst_count, 0) << "no jump to where the profile would be";
    EXPECT_EQ(bench.out.steps.position_steps, counts);
    EXPECT_TRUE(bench.out.status.at_rest);
    for (std::size_t i = 0; i < 3; ++i) {
      const Real x =
          (bench.out.status.commanded_position[i] - testing::kPaperStart[i]) * bench.params().motor[i].steps_per_unit;
      EXPECT_LE(std::fabs(x - static_cast<Real>(counts[i])), 0.5 + 1e-9);
    }
    bench.tick(OperatorCommand::kReset);
    EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed) << "the next tick is in order again";
  }
}

TEST(Controller, TickNumbersAtTheEndOfTheirRange) {
  for (const std::int64_t tick : {std::numeric_limits<std::int64_t>::max(), std::numeric_limits<std::int64_t>::min()}) {
    auto params = std::make_unique<ControllerParams>(testing::paper_params());
    auto state = std::make_unique<ControllerState>();
    reset(*params, *state);
    Outputs out;
    Inputs in;
    for (const std::int64_t t : {std::int64_t{5}, tick, std::int64_t{-5}, tick}) {
      in.tick = t;
      in.sensors.tick = in.monitor.tick = t;
      in.operator_command = OperatorCommand::kArm;
      firmware::tick(*params, *state, in, out);
      EXPECT_EQ(out.status.mode, t == 5 ? Mode::kArmed : Mode::kTripped);
    }
  }
}

TEST(Controller, StepOverloadBrakesFromWhatTheMotorCanFollow) {
  ControllerParams params = testing::paper_params();
  // 0.15 rad/s * 3200/(2 pi) = 76 steps/s; the motor can do 60, which is passed at 0.118 rad/s.
  params.motor[1].max_step_rate_hz = 60;
  Bench bench(params);
  bench.arm_and_start();
  int ticks = 0;
  PerMass<std::int64_t> counts{};
  while (bench.out.status.mode == Mode::kRunning && ticks < 2000) {
    counts = bench.out.steps.position_steps;
    bench.tick();
    ++ticks;
  }
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped);
  EXPECT_EQ(bench.out.status.faults, bit(Fault::kStepOverload));
  const StepOverload overload = bench.out.status.overload;
  EXPECT_EQ(overload.trouble.error, StepError::kTooFast);
  EXPECT_EQ(overload.motor, 1);
  EXPECT_EQ(overload.tick, bench.out.steps.tick);
  // Seen at the first crossing after the rate is passed: 509 steps/s^2 for at most the 1/60 s between two steps.
  EXPECT_GT(overload.trouble.value, 60);
  EXPECT_LT(overload.trouble.value, 69);
  EXPECT_EQ(overload.trouble.limit, 60);
  EXPECT_GE(bench.out.status.commanded_velocity[1], 0.117);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_LE(std::abs(bench.out.steps.position_steps[i] - counts[i]), 1);
  // No motor halts: the slow one brakes from just under its rate, the others from the speed they had.
  const PerMass<Real> speed = bench.out.status.commanded_velocity;
  bench.tick();
  EXPECT_NEAR(bench.out.status.commanded_velocity[1], 60 * 2 * testing::kPi / 3200, 0.002);
  bench.tick();
  for (const std::size_t i : {0u, 2u}) EXPECT_NEAR(bench.out.status.commanded_velocity[i], speed[i], 0.004);
  bench.expect_counts_follow_status(300);
  EXPECT_TRUE(bench.out.status.at_rest);
  EXPECT_EQ(bench.out.status.overload.tick, overload.tick) << "kept until the reset";
  bench.tick(OperatorCommand::kReset);
  EXPECT_EQ(bench.out.status.overload.trouble.error, StepError::kNone);
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed);
}

TEST(Controller, AMotionNoMotorCanStartIsRefusedWithoutAJump) {
  ControllerParams params = testing::paper_params();
  ASSERT_TRUE(params.motion[1].set(0, 1000, nullptr, 0));  // 509 steps a tick
  ASSERT_TRUE(params.motion[2].set(0, 0.1, nullptr, 0));
  Bench bench(params);
  bench.tick(OperatorCommand::kArm);
  bench.tick(OperatorCommand::kStart);
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped);
  EXPECT_EQ(bench.out.status.faults, bit(Fault::kStepOverload));
  EXPECT_LE(bench.out.steps.steps[1], 50) << "50 kHz for a millisecond";
  EXPECT_GT(bench.out.steps.steps[1], 40) << "braking from the speed the motor can follow";
  std::vector<std::int64_t> rates;
  while (!bench.out.status.at_rest && rates.size() < 100000) {
    bench.tick();
    rates.push_back(bench.out.steps.steps[1]);
    ASSERT_LE(rates.back(), 50);
    ASSERT_GE(rates.back(), 0);
  }
  EXPECT_TRUE(bench.out.status.at_rest);
  // 50 kHz / 509 per rad = 98 rad/s, at 2 rad/s^2: 49 s.
  EXPECT_NEAR(static_cast<Real>(rates.size()), 49000, 500);
}

TEST(Controller, EnvelopeIsTheClosedFormAtCommandedMassesAndSensedAttitude) {
  for (const Real mu : {0.35, 0.1, std::numeric_limits<Real>::infinity()}) {
    ControllerParams params = testing::paper_params();
    params.static_friction = mu;
    Bench bench(params);
    bench.in.sensors.orientation = Quaternion(0.9, 0.1, -0.3, 0.2).normalized();
    bench.in.sensors.gyro_B_radps = Vector3(0.2, -0.4, 0.1);
    bench.arm_and_start();
    bench.run(151);  // profile time 0.150: acceleration 0.5
    const ControllerStatus& status = bench.out.status;
    MassMotion masses;
    masses.position = status.commanded_position;
    masses.velocity = status.commanded_velocity;
    for (std::size_t i = 0; i < 3; ++i) masses.acceleration[i] = 0.5;
    const RollingForces f =
        rolling_forces(bench.params().ball, bench.in.sensors.orientation, bench.in.sensors.gyro_B_radps, masses);
    EXPECT_NEAR(status.predicted.normal_force_n, f.normal_force_n, 1e-13) << "rounding of the acceleration";
    EXPECT_NEAR(status.predicted.static_friction_n, f.static_friction_n, 1e-13);
    EXPECT_NEAR(status.mu_required, f.static_friction_n / f.normal_force_n, 1e-13);
    EXPECT_NEAR(status.margin, std::isinf(mu) ? 1 : 1 - f.static_friction_n / (mu * f.normal_force_n), 1e-12);
  }
}

TEST(Controller, WithoutNormalForceTheMarginIsGone) {
  ControllerParams params = testing::paper_params();
  params.static_friction = std::numeric_limits<Real>::infinity();
  params.ball.external_force_W_n = Vector3(0, 0, 10);  // lifts more than the weight of 4
  Bench bench(params);
  bench.tick();
  EXPECT_LT(bench.out.status.predicted.normal_force_n, 0);
  EXPECT_EQ(bench.out.status.mu_required, std::numeric_limits<Real>::infinity());
  EXPECT_EQ(bench.out.status.margin, -1);
}

TEST(Controller, NoMassesAtAll) {
  ControllerParams params = testing::paper_params();
  params.ball.mass_count = 0;
  Bench bench(params);
  bench.arm_and_start();
  bench.run(10);
  EXPECT_TRUE(bench.out.status.at_rest);
  EXPECT_EQ(bench.out.status.motor_count, 0);
  EXPECT_EQ(bench.out.steps.burst_count, 0);
}

// Whatever happens: the commanded position moves no faster than it may, and the count stays with it.
TEST(Controller, RandomLivesKeepCountAndProfileTogether) {
  const unsigned seed = 2718;
  RecordProperty("seed", static_cast<int>(seed));
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> u(-1, 1);
  int trips = 0, restarts = 0, overloads = 0;
  for (int life = 0; life < 60; ++life) {
    ControllerParams params = testing::paper_params();
    for (std::size_t i = 0; i < 3; ++i) {
      ProfilePiece pieces[8];
      for (ProfilePiece& piece : pieces) piece = {0.02 + 0.1 * std::fabs(u(random)), 20 * u(random), 20 * u(random)};
      ASSERT_TRUE(params.motion[i].set(u(random), u(random), pieces, 8));
      params.motor[i].steps_per_unit *= u(random) > 0 ? 4 : -4;
      params.motor[i].max_step_rate_hz = life % 3 == 0 ? 2000 : 50000;
      params.motor[i].max_acceleration = 10;
    }
    Bench bench(params);
    Mode before = Mode::kDisarmed;
    PerMass<std::int64_t> count_before{}, count_now{};
    for (int k = 0; k < 3000; ++k) {
      const auto dice = random() % 1000;
      OperatorCommand command = OperatorCommand::kNone;
      if (dice < 100) command = static_cast<OperatorCommand>(1 + dice % 4);
      bench.in.monitor.tripped = dice == 500;
      bench.in.sensors.gyro_B_radps[0] = dice == 501 ? std::numeric_limits<Real>::quiet_NaN() : 0;
      const bool broken = dice == 502 || dice == 503;
      if (dice == 502) bench.in.tick += 3;
      if (dice == 503) --bench.in.tick;
      bench.tick(command);
      SCOPED_TRACE(::testing::Message() << "seed " << seed << " life " << life << " k " << k);
      for (std::size_t i = 0; i < 3; ++i) {
        const MotorParams& motor = params.motor[i];
        ASSERT_LE(std::abs(bench.out.steps.steps[i]), motor.max_step_rate_hz * 0.001 + 1);
        // The command of two ticks ago ended where this tick's status stands. A repeated tick looks back once more.
        if (k < 2 || dice == 503) continue;
        const Real x =
            (bench.out.status.commanded_position[i] - params.motion[i].at(0).position) * motor.steps_per_unit;
        ASSERT_LE(std::fabs(x - static_cast<Real>(broken ? count_now[i] : count_before[i])), 0.5 + 1e-9)
            << "motor " << i;
      }
      count_before = dice == 503 ? count_before : count_now;
      count_now = bench.out.steps.position_steps;
      const Mode mode = bench.out.status.mode;
      trips += mode == Mode::kTripped && before != Mode::kTripped;
      restarts += mode == Mode::kRunning && before != Mode::kRunning;
      overloads += (bench.out.status.faults & bit(Fault::kStepOverload)) != 0 && before == Mode::kRunning &&
                   mode == Mode::kTripped;
      before = mode;
    }
  }
  EXPECT_GT(trips, 100);
  EXPECT_GT(restarts, 100);
  EXPECT_GT(overloads, 10);
}

TEST(Controller, OverrunsBelongToTheClock) {
  Bench bench;
  bench.out.status.overruns = 42;
  bench.tick();
  EXPECT_EQ(bench.out.status.overruns, 42);
}

TEST(Controller, SameInputsSameOutputs) {
  Bench one, other;
  for (int k = 0; k < 3000; ++k) {
    const OperatorCommand c =
        k == 1 ? OperatorCommand::kArm
               : (k == 5 ? OperatorCommand::kStart : (k == 2000 ? OperatorCommand::kStop : OperatorCommand::kNone));
    one.tick(c);
    other.tick(c);
    ASSERT_EQ(one.out.steps.position_steps, other.out.steps.position_steps);
    ASSERT_EQ(one.out.steps.burst_count, other.out.steps.burst_count);
    ASSERT_EQ(one.out.status.predicted.normal_force_n, other.out.status.predicted.normal_force_n);
  }
}

}  // namespace
}  // namespace ballast::firmware
