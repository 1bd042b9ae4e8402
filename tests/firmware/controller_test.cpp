#include "firmware/control/controller.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "firmware/model/rolling.h"
#include "tests/firmware/paper_ball.h"
#include "tests/firmware/whole_tick.h"
#include "tests/random_seed.h"

namespace ballast::firmware {
namespace {

// A robot on the bench: healthy sensors and heartbeat every tick unless a test spoils them.
class Bench {
 public:
  // `refused`: the motion breaks a limit, so that validate() would keep it from here. What the tick does with it all
  // the same is its own line of defence.
  explicit Bench(const ControllerParams& params = testing::paper_params(), const char* refused = nullptr)
      : params_(std::make_unique<ControllerParams>(params)), state_(std::make_unique<ControllerState>()) {
    const ParamError error = validate(*params_);
    EXPECT_STREQ(error.field, refused);
    reset(*params_, *state_);
  }

  // Serves one tick; what happened to the count is checked against the profile the status reports.
  const Outputs& tick(const OperatorInput& command = OperatorCommand::kNone) {
    if (sensors_alive) in.sensors.tick = in.tick;
    if (monitor_alive) in.monitor.tick = in.tick - 1;
    in.operator_command = command;
    const PerMass<std::int64_t> before = state_->position_steps;
    whole_tick(*params_, *state_, in, out);
    EXPECT_EQ(out.steps.tick, in.tick + 1);
    EXPECT_EQ(out.steps.motor_count, params_->ball.mass_count);
    EXPECT_EQ(out.status.tick, in.tick);
    EXPECT_EQ(out.status.scenario_id, params_->scenario_id);
    EXPECT_EQ(out.status.mode, state_->mode);
    PerMass<std::int64_t> pulses{};
    for (int b = 0; b < out.steps.burst_count; ++b) {
      const StepBurst& burst = out.steps.bursts[static_cast<std::size_t>(b)];
      pulses[burst.motor] += static_cast<std::int64_t>(burst.direction * burst.count);
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

  // Asks for a move and waits until it is due; then the masses move from the next tick on.
  void move(const MoveRequest& request) {
    tick(request);
    while (out.status.mode == Mode::kPending) {
      ASSERT_LT(in.tick, out.status.plan_tick);
      tick();
    }
  }

  void arm_and_start() {
    tick(OperatorCommand::kArm);
    EXPECT_EQ(out.status.mode, Mode::kArmed);
    tick(OperatorCommand::kStart);
    EXPECT_EQ(out.status.mode, Mode::kRunning);
  }

  // The rule of step_generator.h: after tick k's command, the count is the nearest to the profile at the start of tick
  // k + 2, which is what the status of tick k + 2 reports. So compare a command with the status two ticks later.
  // `late`: microsteps more, where pulses are late to keep their distances.
  void expect_counts_follow_status(int ticks, Real late = 0) {
    std::vector<PerMass<std::int64_t>> counts;
    for (int k = 0; k < ticks; ++k) {
      tick();
      counts.push_back(out.steps.position_steps);
      if (k < 2) continue;
      for (int i = 0; i < params_->ball.mass_count; ++i) {
        const auto m = static_cast<std::size_t>(i);
        const Real x =
            (out.status.commanded_position[m] - params_->motion[m].at(0).position) * params_->motor[m].steps_per_unit;
        ASSERT_LE(std::fabs(x - static_cast<Real>(counts[static_cast<std::size_t>(k - 2)][m])), 0.5 + late + 1e-9)
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
  // The deceleration grows at 20 rad/s^3.
  EXPECT_NEAR(bench.out.status.commanded_velocity[0], 0.15 - 20 * 1e-6 / 2, 1e-12);
  const Real before = bench.out.status.commanded_position[0];
  // A triangle of peak sqrt(20 * 0.15) = 1.73 < 2: twice sqrt(0.15 / 20) = 173.2 ms; two ticks of them are over.
  int ticks = 0;
  while (bench.out.status.mode == Mode::kStopping && ticks < 1000) {
    EXPECT_FALSE(bench.out.status.at_rest);
    bench.tick();
    ++ticks;
  }
  EXPECT_NEAR(ticks, 171, 1);
  EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
  EXPECT_TRUE(bench.out.status.at_rest);
  bench.run(2);
  EXPECT_EQ(bench.out.status.commanded_velocity[0], 0);
  // The velocity falls symmetrically about half of it, so the way is v T / 2; of it the first tick is over.
  EXPECT_NEAR(bench.out.status.commanded_position[0] - before,
              0.15 * std::sqrt(0.15 / 20) - (0.15 * 0.001 - 20 * 1e-9 / 6), 1e-12);
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
  for (int kind = 0; kind < 9; ++kind) {
    Bench bench;
    bench.arm_and_start();
    bench.run(400);
    if (kind == 7) bench.in.sensors.gyro_B_radps[2] = 2e15;  // whose square is still a number
    if (kind == 8) bench.in.sensors.accelerometer_B_mps2[0] = -2e15;
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

// A mass at an end of its rail is a fault while it is commanded on over it; not at rest, and not on its way back.
TEST(Controller, AMassAtItsEndSwitchTripsIfItIsCommandedOn) {
  Bench bench;
  bench.in.sensors.limit_switch[0] = 3;  // nothing is commanded
  bench.arm_and_start();
  bench.in.sensors.limit_switch[0] = 1;
  bench.run(500);
  EXPECT_EQ(bench.out.status.mode, Mode::kRunning) << "up, away from the lower end";
  EXPECT_GT(bench.out.status.commanded_velocity[0], 0);
  bench.in.sensors.limit_switch[0] = 2;
  bench.tick();
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped);
  EXPECT_EQ(bench.out.status.faults, bit(Fault::kEndSwitch));
  expect_braking_then_holding(bench);
  // The switch is still closed, but nothing is asked of the mass: it may be taken back, and no further on.
  bench.tick(OperatorCommand::kReset);
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed);
  EXPECT_EQ(bench.out.status.faults, 0u);
  bench.tick(OperatorCommand::kArm);
  MoveRequest move;
  move.masses = 1;
  move.target_position[0] = bench.out.status.commanded_position[0] - 0.05;
  bench.move(move);
  bench.run(100);
  EXPECT_EQ(bench.out.status.mode, Mode::kMoving) << "down, away from the upper end";
  bench.in.sensors.limit_switch[0] = 1;
  bench.tick();
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped);
}

// Stops end a line before the ball does. The line is drawn where the rotor's swing would close the end's switch.
TEST(Controller, AMoveToAnEndStopOrBeyondIsRefused) {
  ControllerParams params = testing::paper_params();
  params.ball.rail[1] = line(Vector3(0, 0, 0), Vector3(1, 0, 0));
  params.ball.rail[1].lower_end = -0.3;
  params.ball.rail[1].upper_end = 0.35;
  params.motion[1] = Profile();
  params.motor[1].swing = 0.004;
  Bench bench(params);
  bench.tick(OperatorCommand::kArm);
  MoveRequest move;
  move.masses = 2;
  for (const Wide target : {-0.31, -0.3, -0.2961, 0.3461, 0.35, 0.36, 1e300, -1e300}) {
    move.target_position[1] = target;
    bench.tick(move);
    EXPECT_EQ(bench.out.status.refusal.reason, target < 0 ? Refusal::kLowerEnd : Refusal::kUpperEnd) << target;
    EXPECT_EQ(bench.out.status.refusal.motor, 1);
    EXPECT_EQ(bench.out.status.refusal.value, target < 0 ? -0.3 + 0.004 : 0.35 - 0.004) << "what is allowed";
    EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
  }
  move.target_position[1] = 0.35 - 0.004;
  bench.tick(move);
  EXPECT_EQ(bench.out.status.refusal.reason, Refusal::kNone);
  EXPECT_EQ(bench.out.status.mode, Mode::kPending);

  params.ball.rail[1].upper_end = -0.3;
  EXPECT_STREQ(validate(params).field, "ball.rail.lower_end");
  params.ball.rail[1].upper_end = std::numeric_limits<Real>::quiet_NaN();
  EXPECT_STREQ(validate(params).field, "ball.rail.lower_end");
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
  EXPECT_NEAR(bench.out.status.commanded_velocity[0], 0.15 - 20 * 1e-6 / 2, 1e-12);
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
      whole_tick(*params, *state, in, out);
      EXPECT_EQ(out.status.mode, t == 5 ? Mode::kArmed : Mode::kTripped);
    }
  }
}

// validate() refuses such motions; what the tick does with one all the same is an ordinary stop, in which the motor
// that cannot be stepped holds.
TEST(Controller, AStepOverloadIsAFaultAndAStop) {
  ControllerParams params = testing::paper_params();
  // 0.15 rad/s * 3200/(2 pi) = 76 steps/s; the motor can do 60, which is passed at 0.118 rad/s.
  params.motor[1].max_step_rate_hz = 60;
  Bench bench(params, "motion speed");
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
  EXPECT_EQ(bench.out.steps.position_steps[1], counts[1]) << "it holds";
  // The others stop from the speed they had, as at an operator's stop.
  const PerMass<Real> speed = bench.out.status.commanded_velocity;
  bench.tick();
  EXPECT_EQ(bench.out.status.commanded_velocity[1], 0);
  bench.tick();
  for (const std::size_t i : {0u, 2u}) EXPECT_NEAR(bench.out.status.commanded_velocity[i], speed[i], 0.004);
  bench.expect_counts_follow_status(300);
  EXPECT_TRUE(bench.out.status.at_rest);
  EXPECT_EQ(bench.out.status.overload.tick, overload.tick) << "kept until the reset";
  bench.tick(OperatorCommand::kReset);
  EXPECT_EQ(bench.out.status.overload.trouble.error, StepError::kNone);
  EXPECT_EQ(bench.out.status.mode, Mode::kDisarmed);
}

TEST(Controller, AMotionNoMotorCanStartMovesNothingButTheOthers) {
  ControllerParams params = testing::paper_params();
  ASSERT_TRUE(params.motion[1].set(0, 140, nullptr, 0));  // 71 steps a tick, 70 s to rest
  ASSERT_TRUE(params.motion[2].set(0, 0.1, nullptr, 0));
  Bench bench(params, "motion speed");
  bench.tick(OperatorCommand::kArm);
  bench.tick(OperatorCommand::kStart);
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped);
  EXPECT_EQ(bench.out.status.faults, bit(Fault::kStepOverload));
  const StepOverload overload = bench.out.status.overload;
  EXPECT_EQ(overload.trouble.error, StepError::kTooManySteps);
  EXPECT_EQ(overload.motor, 1);
  Real last_speed = 1;
  for (int k = 0; k < 100000 && !bench.out.status.at_rest; ++k) {
    bench.tick();
    ASSERT_EQ(bench.out.steps.steps[1], 0);
    ASSERT_LE(bench.out.status.commanded_velocity[2], last_speed + 1e-12) << "braking";
    last_speed = bench.out.status.commanded_velocity[2];
  }
  EXPECT_TRUE(bench.out.status.at_rest);
  EXPECT_EQ(bench.out.steps.position_steps[1], 0);
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

// From any tick of the paper's run, in the middle of its pieces too: all masses end together, in the time of the
// slowest, inside acceleration and jerk, without turning back.
TEST(Controller, AStopFromAnyTickOfThePaperMotionKeepsTheLimitsAndEndsTogether) {
  ControllerParams params = testing::paper_params();
  params.motor[1].max_acceleration = 1;  // the slowest
  for (const int ticks : {0, 1, 30, 99, 100, 101, 150, 199, 200, 201, 700}) {
    SCOPED_TRACE(::testing::Message() << ticks << " ticks");
    Bench bench(params);
    bench.arm_and_start();
    bench.run(ticks);
    bench.tick(OperatorCommand::kStop);
    EXPECT_FALSE(bench.out.status.planned) << "it is predicted while it runs";
    EXPECT_EQ(bench.out.status.plan_tick, bench.in.tick) << "from the next tick on";
    const Real duration = bench.out.status.plan.duration_s;
    PerMass<std::vector<Real>> velocity;
    int rested = -1;
    for (int k = 0; k < 600 && rested < 0; ++k) {
      bench.tick();
      for (std::size_t i = 0; i < 3; ++i) velocity[i].push_back(bench.out.status.commanded_velocity[i]);
      if (bench.out.status.at_rest) rested = k;
    }
    // at_rest speaks of the start of the next tick.
    EXPECT_NEAR(rested + 1, std::ceil(duration / 0.001 - 1e-9), 1);
    for (std::size_t i = 0; i < 3; ++i) {
      const MotorParams& motor = params.motor[i];
      // Differences of velocities a tick apart: mean acceleration and jerk of the ticks; 1e-9: their rounding.
      for (std::size_t k = 1; k < velocity[i].size(); ++k) {
        ASSERT_LE(std::fabs(velocity[i][k] - velocity[i][k - 1]), motor.max_acceleration * 1e-3 * (1 + 1e-9));
        ASSERT_GE(velocity[i][k], -1e-15) << "rounding of a cubic that ends at 0";
        if (k < 2) continue;
        ASSERT_LE(std::fabs(velocity[i][k] - 2 * velocity[i][k - 1] + velocity[i][k - 2]),
                  motor.max_jerk * 1e-6 * (1 + 1e-6) + 1e-15);
      }
      // Together: still moving shortly before the end (where it had speed at all).
      if (ticks > 1) {
        ASSERT_GT(velocity[i].size(), 5u);
        EXPECT_GT(velocity[i][velocity[i].size() - 4], 0) << "motor " << i;
      }
    }
  }
}

TEST(Controller, MovesReachTheirTargetsTogetherAndAreArmedAgain) {
  Bench bench;
  bench.tick(OperatorCommand::kArm);
  MoveRequest move;
  move.masses = 0b101;
  move.target_position[0] = 0.4;
  move.target_position[1] = std::numeric_limits<Real>::quiet_NaN();  // not asked for: not read
  move.target_position[2] = testing::kPaperStart[2] - 0.05;
  bench.move(move);
  ASSERT_EQ(bench.out.status.mode, Mode::kMoving);
  EXPECT_EQ(bench.out.status.refusal.reason, Refusal::kNone);
  EXPECT_EQ(bench.out.status.plan_tick, bench.in.tick);
  EXPECT_TRUE(bench.out.status.planned);
  // 0.4 = 2 j t^3: a peak of 20 t = 4.3 is more than 2, so v (v / 2 + 0.1) = 0.4: v = 0.8, twice 0.4 + 0.1 s.
  EXPECT_NEAR(bench.out.status.plan.duration_s, 1, 1e-12);
  EXPECT_GT(bench.out.status.plan.margin_min, -1);
  for (int k = 0; k < 997; ++k) {
    bench.tick();
    ASSERT_EQ(bench.out.status.mode, Mode::kMoving) << k;
    ASSERT_EQ(bench.out.status.commanded_position[1], testing::kPaperStart[1]);
  }
  EXPECT_GT(bench.out.status.commanded_velocity[0], 0) << "all take the whole second";
  EXPECT_LT(bench.out.status.commanded_velocity[2], 0);
  bench.run(4);
  EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
  EXPECT_TRUE(bench.out.status.at_rest);
  // Seven pieces' rounding.
  EXPECT_NEAR(bench.out.status.commanded_position[0], 0.4, 1e-14);
  EXPECT_NEAR(bench.out.status.commanded_position[2], testing::kPaperStart[2] - 0.05, 1e-14);
  const std::int64_t expected = std::llround(0.4 * 3200 / (2 * testing::kPi));
  EXPECT_EQ(bench.out.steps.position_steps[0], expected);

  // The next one goes on from there, slower; a stop ends it, and then the motion runs from where the masses stand.
  move.masses = 1;
  move.target_position[0] = -0.4;
  move.speed_fraction = 0.25;
  bench.move(move);
  ASSERT_EQ(bench.out.status.mode, Mode::kMoving);
  EXPECT_GT(bench.out.status.plan.duration_s, 4);
  bench.expect_counts_follow_status(1500);
  bench.tick(OperatorCommand::kStop);
  EXPECT_EQ(bench.out.status.mode, Mode::kStopping);
  bench.expect_counts_follow_status(600);
  EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
  const PerMass<Real> stands = bench.out.status.commanded_position;
  EXPECT_GT(stands[0], -0.4);
  bench.tick(OperatorCommand::kStart);
  bench.tick();
  EXPECT_EQ(bench.out.status.commanded_position, stands);
  bench.expect_counts_follow_status(300);
}

TEST(Controller, ATripDuringAMoveStopsIt) {
  Bench bench;
  bench.tick(OperatorCommand::kArm);
  MoveRequest move;
  move.masses = 7;
  move.target_position = {1, 1, 1};
  bench.move(move);
  bench.run(300);
  bench.in.monitor.tripped = true;
  bench.tick();
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped);
  EXPECT_EQ(bench.out.status.plan_tick, bench.in.tick) << "the stop begins in the next tick";
  bench.expect_counts_follow_status(2000);
  EXPECT_TRUE(bench.out.status.at_rest);
  EXPECT_LT(bench.out.status.commanded_position[0], 0.9);
}

MoveRequest move_all(Wide target, std::uint32_t masses = 7) {
  MoveRequest move;
  move.masses = masses;
  move.target_position.fill(target);
  return move;
}

// The masses hold while a move is pending; it begins in the tick announced, with its prediction complete.
TEST(Controller, AMoveIsPendingUntilItIsPredicted) {
  static_assert(kMostPendingTicks == 16);
  struct Case {
    std::uint32_t masses;
    int pieces;
  };
  ControllerParams params = testing::paper_params();
  for (MotorParams& motor : params.motor) motor.max_step_rate_hz = 300;  // so that there is a cruise
  for (const Case& c : {Case{1, 7}, Case{7, 21}}) {
    Bench bench(params);
    bench.tick(OperatorCommand::kArm);
    const std::int64_t asked = bench.in.tick;
    bench.tick(move_all(2, c.masses));
    const std::int64_t begins = bench.out.status.plan_tick;
    EXPECT_EQ(begins, asked + pending_ticks(c.pieces) + 1);
    EXPECT_GT(bench.out.status.plan.duration_s, 0) << "known at once";
    const Wide duration_s = bench.out.status.plan.duration_s;
    bool was_planned = false;
    for (; bench.in.tick < begins - 1; bench.tick()) {
      ASSERT_EQ(bench.out.status.mode, Mode::kPending);
      ASSERT_TRUE(bench.out.status.at_rest);
      ASSERT_EQ(bench.out.status.plan_tick, begins);
      ASSERT_EQ(bench.out.status.plan.duration_s, duration_s);
      ASSERT_EQ(bench.out.steps.burst_count, 0);
      if (!bench.out.status.planned) {
        ASSERT_EQ(bench.out.status.plan.horizon_s, 0);
      }
      ASSERT_TRUE(bench.out.status.planned || !was_planned);
      was_planned = bench.out.status.planned;
    }
    EXPECT_EQ(bench.out.status.mode, Mode::kPending);
    EXPECT_TRUE(bench.out.status.planned) << "before it begins";
    EXPECT_GT(bench.out.status.plan.normal_force_min_n, 0);
    bench.tick();
    EXPECT_EQ(bench.out.status.mode, Mode::kMoving);
    EXPECT_FALSE(bench.out.status.at_rest);
    for (int i = 0; i < 3; ++i) {
      const auto m = static_cast<std::size_t>(i);
      EXPECT_EQ(bench.out.status.next[m].position, testing::kPaperStart[m])
          << "profile time 0 is the next tick's start";
      EXPECT_EQ(bench.out.status.next[m].velocity, 0);
    }
    bench.tick();
    EXPECT_GT(bench.out.status.next[0].velocity, 0);
  }
}

TEST(Controller, AStopOrAFaultCancelsAPendingMove) {
  for (const int after : {0, 3, pending_ticks(21) - 1}) {
    for (const bool fault : {false, true}) {
      SCOPED_TRACE(::testing::Message() << (fault ? "fault " : "stop ") << after << " ticks later");
      Bench bench;
      bench.tick(OperatorCommand::kArm);
      bench.tick(move_all(1));
      bench.run(after);
      EXPECT_EQ(bench.out.status.mode, Mode::kPending);
      bench.in.monitor.tripped = fault;
      bench.tick(fault ? OperatorCommand::kNone : OperatorCommand::kStop);
      bench.in.monitor.tripped = false;
      EXPECT_EQ(bench.out.status.mode, fault ? Mode::kTripped : Mode::kArmed);
      // The last command is the move in the one case, the stop in the other, which was obeyed.
      EXPECT_EQ(bench.out.status.refusal.reason, fault ? Refusal::kCancelled : Refusal::kNone);
      EXPECT_EQ(bench.out.status.operator_commands, fault ? 2 : 3);
      bench.run(100);
      EXPECT_FALSE(bench.out.status.planned);
      EXPECT_EQ(bench.out.status.plan_tick, 0);
      EXPECT_EQ(bench.out.status.plan.duration_s, 0);
      EXPECT_EQ(bench.out.status.steps_issued, (PerMass<std::int64_t>{})) << "nothing has moved";
      EXPECT_EQ(bench.out.status.mode, fault ? Mode::kTripped : Mode::kArmed);
      if (fault) {
        bench.tick(OperatorCommand::kReset);
        bench.tick(OperatorCommand::kArm);
      }
      bench.move(move_all(1));
      EXPECT_EQ(bench.out.status.mode, Mode::kMoving);
      EXPECT_TRUE(bench.out.status.planned);
    }
  }
}

TEST(Controller, NothingElseBeginsWhileAMoveIsPending) {
  Bench bench;
  bench.tick(OperatorCommand::kArm);
  bench.tick(move_all(1));
  const std::int64_t begins = bench.out.status.plan_tick;
  for (const OperatorInput& command : {OperatorInput(OperatorCommand::kStart), OperatorInput(move_all(0.5)),
                                       OperatorInput(OperatorCommand::kArm), OperatorInput(OperatorCommand::kReset)}) {
    bench.tick(command);
    EXPECT_EQ(bench.out.status.refusal.reason, Refusal::kMode);
    EXPECT_EQ(bench.out.status.mode, Mode::kPending);
    EXPECT_EQ(bench.out.status.plan_tick, begins);
  }
  bench.run(3000);
  EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
  EXPECT_NEAR(bench.out.status.commanded_position[0], 1, 1e-14) << "the first move";
}

// Motors that stop from a speed of 2e-3 in a few ticks.
ControllerParams quick_params() {
  ControllerParams params = testing::paper_params();
  for (MotorParams& motor : params.motor) {
    motor.max_acceleration = 20;
    motor.max_jerk = 2e4;
  }
  return params;
}

// A stop from hardly any speed ends before its prediction is complete; that goes on while the masses hold.
TEST(Controller, AStopIsPredictedAlsoAfterItsEnd) {
  Bench bench(quick_params());
  bench.arm_and_start();
  bench.run(1);
  bench.tick(OperatorCommand::kStop);
  int rested = 0, planned = 0;
  for (int k = 1; k <= 20; ++k) {
    bench.tick();
    if (bench.out.status.at_rest && rested == 0) rested = k;
    if (bench.out.status.planned && planned == 0) planned = k;
  }
  EXPECT_GT(rested, 0);
  EXPECT_GT(planned, rested);
  EXPECT_EQ(bench.out.status.plan.horizon_s, bench.out.status.plan.duration_s);
  EXPECT_LT(bench.out.status.plan.normal_force_min_n, bench.out.status.predicted.normal_force_n);
}

// Masses that a governor braked can be left with such a speed.
TEST(Controller, StopsFromASpeedThatRoundingLeft) {
  ControllerParams params = testing::paper_params();
  for (std::size_t i = 0; i < 3; ++i) {
    const ProfilePiece piece{0.1, 0, i == 0 ? -1e-320 : 0};
    ASSERT_TRUE(params.motion[i].set(0, std::numeric_limits<Wide>::denorm_min(), &piece, 1));
  }
  Bench bench(params);
  bench.arm_and_start();
  bench.run(50);
  bench.tick(OperatorCommand::kStop);
  bench.run(2);
  EXPECT_EQ(bench.out.status.faults, 0u);
  EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
  EXPECT_TRUE(bench.out.status.at_rest);
}

// A prediction of a stop ends when something takes the profiles' place: a start, a move, and those that
// are refused after they were planned. A command that the mode refuses does not end it.
TEST(Controller, AStartOrMoveDropsAStopsPrediction) {
  enum class What { kNothing, kStart, kMove, kRefusedMove, kRefusedMode };
  for (const What what : {What::kNothing, What::kStart, What::kMove, What::kRefusedMove, What::kRefusedMode}) {
    SCOPED_TRACE(static_cast<int>(what));
    Bench bench(quick_params());
    bench.arm_and_start();
    bench.run(1);
    bench.tick(OperatorCommand::kStop);
    const std::int64_t stop_tick = bench.out.status.plan_tick;
    while (bench.out.status.mode != Mode::kArmed) bench.tick();
    ASSERT_FALSE(bench.out.status.planned);
    bench.tick(what == What::kNothing       ? OperatorInput(OperatorCommand::kNone)
               : what == What::kStart       ? OperatorInput(OperatorCommand::kStart)
               : what == What::kMove        ? OperatorInput(move_all(1))
               : what == What::kRefusedMove ? OperatorInput(move_all(std::numeric_limits<Wide>::infinity()))
                                            : OperatorInput(OperatorCommand::kArm));
    bench.run(30);
    const bool goes_on = what == What::kNothing || what == What::kRefusedMode;
    EXPECT_EQ(bench.out.status.planned, goes_on || what == What::kMove);
    const std::int64_t plan_tick = bench.out.status.plan_tick;
    EXPECT_EQ(plan_tick == stop_tick, goes_on);
    EXPECT_EQ(plan_tick > stop_tick, what == What::kMove);
    EXPECT_EQ(plan_tick == 0, what == What::kStart || what == What::kRefusedMove);
  }
}

// A trip during an ordinary stop goes on with that stop, and with its prediction.
TEST(Controller, ATripKeepsTheStopAndItsPrediction) {
  Bench bench, other;
  for (Bench* b : {&bench, &other}) {
    b->arm_and_start();
    b->run(500);
    b->tick(OperatorCommand::kStop);
    b->run(3);
    b->in.monitor.tripped = b == &other;
    b->run(30);
    ASSERT_TRUE(b->out.status.planned);
  }
  EXPECT_EQ(other.out.status.mode, Mode::kTripped);
  EXPECT_EQ(other.out.status.plan_tick, bench.out.status.plan_tick);
  EXPECT_EQ(other.out.status.plan.margin_min, bench.out.status.plan.margin_min);
}

TEST(Controller, WithoutAnAttitudeAStopsPredictionIsUnknownAtOnce) {
  Bench bench;
  bench.arm_and_start();
  bench.run(500);
  bench.in.sensors.gyro_B_radps[0] = std::numeric_limits<Real>::quiet_NaN();
  bench.tick();
  EXPECT_EQ(bench.out.status.mode, Mode::kTripped);
  EXPECT_TRUE(bench.out.status.planned);
  EXPECT_GT(bench.out.status.plan.duration_s, 0);
  EXPECT_EQ(bench.out.status.plan.horizon_s, 0);
  EXPECT_TRUE(std::isnan(bench.out.status.plan.normal_force_min_n));
  EXPECT_TRUE(std::isinf(bench.out.status.plan.mu_required_max));
  EXPECT_EQ(bench.out.status.plan.margin_min, -1);
  bench.in.sensors = Sensors{};
  bench.run(30);
  EXPECT_EQ(bench.out.status.plan.horizon_s, 0);
}

TEST(Controller, RefusedMovesSayWhyAndMoveNothing) {
  constexpr Real kNan = std::numeric_limits<Real>::quiet_NaN();
  ControllerParams params = testing::paper_params();
  params.ball.rail[1] = line(Vector3(0, 0, -0.6), Vector3(1, 0, 0));  // leaves the ball at 0.8
  ASSERT_TRUE(params.motion[1].set(0, 0, testing::kPaperMotion, 2));
  struct Case {
    std::uint32_t masses;
    Real target, speed_fraction;
    Refusal reason;
    int motor;
    Real value;
  };
  for (const Case& c :
       {Case{0, 0, 1, Refusal::kNoMass, -1, 0}, Case{8, 0, 1, Refusal::kUnknownMass, 3, 3},
        Case{1u << 31, 0, 1, Refusal::kUnknownMass, 31, 31}, Case{2, 0.81, 1, Refusal::kUpperEnd, 1, 0.8},
        Case{2, -0.81, 1, Refusal::kLowerEnd, 1, -0.8}, Case{1, 1e300, 1, Refusal::kTarget, 0, 1e300},
        Case{4, kNan, 1, Refusal::kTarget, 2, kNan}, Case{1, 1, 0, Refusal::kSpeedFraction, -1, 0},
        Case{1, 1, 1.01, Refusal::kSpeedFraction, -1, 1.01}, Case{1, 1, kNan, Refusal::kSpeedFraction, -1, kNan}}) {
    Bench bench(params);
    bench.tick(OperatorCommand::kArm);
    MoveRequest move;
    move.masses = c.masses;
    move.target_position.fill(c.target);
    move.speed_fraction = c.speed_fraction;
    bench.tick(move);
    EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
    EXPECT_EQ(bench.out.status.refusal.reason, c.reason);
    EXPECT_EQ(bench.out.status.refusal.motor, c.motor);
    // Where the line meets the ball is a square root.
    EXPECT_TRUE(std::fabs(bench.out.status.refusal.value - c.value) <= 1e-15 * std::fabs(c.value) ||
                std::isnan(c.value));
    bench.run(10);
    EXPECT_EQ(bench.out.status.refusal.reason, c.reason) << "stays until the next command";
    EXPECT_EQ(bench.out.steps.position_steps[0], 0);
    move.masses = 2;
    move.target_position[1] = 0.79;
    move.speed_fraction = 1;
    bench.tick(move);
    EXPECT_EQ(bench.out.status.mode, Mode::kPending);
    EXPECT_EQ(bench.out.status.refusal.reason, Refusal::kNone);
    bench.move(move);
    EXPECT_EQ(bench.out.status.mode, Mode::kMoving);
    EXPECT_EQ(bench.out.status.refusal.reason, Refusal::kMode) << "one at a time";
  }
  Bench disarmed;
  MoveRequest move;
  move.masses = 1;
  disarmed.tick(move);
  EXPECT_EQ(disarmed.out.status.refusal.reason, Refusal::kMode);
}

// 0.8 m along x, straight; beyond its ends the ball would still have room.
Rail open_spline() {
  Rail rail;
  rail.shape = RailShape::kSpline;
  rail.piece_count = 4;
  rail.piece_length_m = 0.2;
  for (int k = 0; k <= 4; ++k) rail.knots[static_cast<std::size_t>(k)].position_B_m = Vector3(0.2 * k - 0.4, 0, -0.6);
  return rail;
}

TEST(Controller, MovesStayOnAnOpenSplineAndGoRoundAClosedOne) {
  struct Case {
    bool closed;
    Real target;
    bool allowed;
  };
  for (const Case& c : {Case{false, 0.8, true}, Case{false, 0, true}, Case{false, 0.801, false},
                        Case{false, -0.001, false}, Case{true, -3, true}, Case{true, 12, true}}) {
    SCOPED_TRACE(::testing::Message() << (c.closed ? "closed" : "open") << " to " << c.target);
    ControllerParams params = testing::paper_params();
    params.ball.rail[1] = c.closed ? testing::wavy_spline() : open_spline();
    ASSERT_TRUE(params.motion[1].set(0.3, 0, testing::kPaperMotion, 2));
    Bench bench(params);
    bench.tick(OperatorCommand::kArm);
    MoveRequest move;
    move.masses = 2;
    move.target_position[1] = c.target;
    bench.move(move);
    EXPECT_EQ(bench.out.status.mode, c.allowed ? Mode::kMoving : Mode::kArmed);
    EXPECT_EQ(bench.out.status.refusal.reason, c.allowed      ? Refusal::kNone
                                               : c.target < 0 ? Refusal::kLowerEnd
                                                              : Refusal::kUpperEnd);
    EXPECT_EQ(bench.out.status.refusal.motor, c.allowed ? -1 : 1);
    // Limits and plan are those of a line: 12.3 m at 2 m/s^2 take 5.1 s.
    bench.expect_counts_follow_status(5500);
    EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
    // Seven pieces' rounding.
    EXPECT_NEAR(bench.out.status.commanded_position[1], c.allowed ? c.target : 0.3, 1e-13);
  }
}

// Mass 0 needs 0.15 / 0.1 + 0.1 / 20 = 1.505 s to stop. Stretched to that, a mass at 0.15 m/s goes 0.113 m further,
// alone 0.15 sqrt(0.15 / 20) = 0.013 m.
TEST(Controller, AStretchedStopDoesNotLeaveTheRail) {
  struct Case {
    bool spline;
    Real start, velocity;
    bool stretched;
  };
  for (const Case& c : {Case{true, 0.7, 0.15, false}, Case{true, 0.1, -0.15, false}, Case{true, 0.4, 0.15, true},
                        Case{true, 0.4, -0.15, true}, Case{false, 0.7, 0.15, false}, Case{false, 0.1, -0.15, true}}) {
    SCOPED_TRACE(::testing::Message() << (c.spline ? "spline" : "line") << " from " << c.start << " at " << c.velocity);
    ControllerParams params = testing::paper_params();
    // Both end at 0.8: the line there leaves the ball.
    params.ball.rail[1] = c.spline ? open_spline() : line(Vector3(0, 0, -0.6), Vector3(1, 0, 0));
    ASSERT_TRUE(params.motion[0].set(0, 0.15, nullptr, 0));
    ASSERT_TRUE(params.motion[1].set(c.start, c.velocity, nullptr, 0));
    params.motor[0].max_acceleration = 0.1;
    Bench bench(params);
    bench.arm_and_start();
    bench.run(200);
    bench.tick(OperatorCommand::kStop);
    bench.tick();
    const Real from = bench.out.status.commanded_position[1];
    bench.expect_counts_follow_status(2000);
    ASSERT_EQ(bench.out.status.mode, Mode::kArmed);
    const Real way = std::fabs(bench.out.status.commanded_position[1] - from);
    // A stop's velocity falls symmetrically about half of it; rounding of its pieces.
    EXPECT_NEAR(way, 0.15 * (c.stretched ? 1.505 / 2 : std::sqrt(0.15 / 20)), 1e-12);
  }
}

TEST(Controller, ARestartThatWouldBreakALimitIsRefusedByName) {
  ControllerParams params = testing::paper_params();
  // From -4 rad/s up by 8 to 4 it keeps a limit of 5; from rest it would reach 8.
  const ProfilePiece up[] = {{4, 2, 2}, {2, -2, -2}};
  ASSERT_TRUE(params.motion[1].set(0, -4, up, 2));
  params.motor[1].max_step_rate_hz = 5 * 3200 / (2 * testing::kPi);
  Bench bench(params);
  bench.arm_and_start();
  bench.run(100);
  bench.tick(OperatorCommand::kStop);
  for (int k = 0; k < 5000 && bench.out.status.mode != Mode::kArmed; ++k) bench.tick();
  ASSERT_EQ(bench.out.status.mode, Mode::kArmed);
  bench.tick(OperatorCommand::kStart);
  EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
  EXPECT_EQ(bench.out.status.refusal.reason, Refusal::kVelocity);
  EXPECT_EQ(bench.out.status.refusal.motor, 1);
  EXPECT_EQ(bench.out.status.refusal.piece, 0);
  EXPECT_NEAR(bench.out.status.refusal.value, 8, 1e-12);
  const PerMass<std::int64_t> counts = bench.out.steps.position_steps;
  bench.run(10);
  EXPECT_EQ(bench.out.steps.position_steps, counts);
}

TEST(Controller, ARestartThatWouldLeaveTheRailIsRefusedByName) {
  for (const bool spline : {true, false}) {
    ControllerParams params = testing::paper_params();
    // Both end at 0.8. From 0.4 to 0.65 and back to 0.6, at rest in the end; from 0.6 it would turn at 0.85.
    params.ball.rail[1] = spline ? open_spline() : line(Vector3(0, 0, -0.6), Vector3(1, 0, 0));
    const ProfilePiece pieces[] = {{0.5, 1, 1}, {0.5, -1, -1}, {std::sqrt(0.05), -1, -1}, {std::sqrt(0.05), 1, 1}};
    ASSERT_TRUE(params.motion[1].set(0.4, 0, pieces, 4));
    Bench bench(params);
    bench.arm_and_start();
    bench.run(1500);
    bench.tick(OperatorCommand::kStop);
    bench.run(500);
    ASSERT_EQ(bench.out.status.mode, Mode::kArmed);
    ASSERT_NEAR(bench.out.status.commanded_position[1], 0.6, 1e-12);
    const PerMass<std::int64_t> counts = bench.out.steps.position_steps;
    bench.tick(OperatorCommand::kStart);
    EXPECT_EQ(bench.out.status.mode, Mode::kArmed);
    EXPECT_EQ(bench.out.status.refusal.reason, Refusal::kRailEnd);
    EXPECT_EQ(bench.out.status.refusal.motor, 1);
    EXPECT_EQ(bench.out.status.refusal.piece, 1);
    EXPECT_NEAR(bench.out.status.refusal.value, 0.85, 1e-12);
    bench.run(10);
    EXPECT_EQ(bench.out.steps.position_steps, counts);
    MoveRequest back;
    back.masses = 2;
    back.target_position[1] = 0.5;
    bench.tick(back);
    bench.run(1000);
    ASSERT_EQ(bench.out.status.mode, Mode::kArmed);
    bench.tick(OperatorCommand::kStart);
    EXPECT_EQ(bench.out.status.mode, Mode::kRunning) << "from 0.5 it turns at 0.75";
  }
}

// In every life the commanded position keeps its rate limit, and the count stays with it.
TEST(Controller, RandomLivesKeepCountAndProfileTogether) {
  const auto seed = static_cast<unsigned>(ballast::test::random_seed(2718));
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
      params.motor[i].max_step_rate_hz = life % 3 == 0 ? 2000 : 25000;
      // Above what the motion needs: only its speed is refused, in some lives.
      params.motor[i].max_acceleration = 20;
      params.motor[i].max_jerk = 2000;
    }
    const ParamError error = validate(params);
    Bench bench(params, error.field);
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
      // Some in the first tick of all: later starts that would are refused.
      overloads += (bench.out.status.faults & bit(Fault::kStepOverload)) != 0 && before != Mode::kTripped &&
                   mode == Mode::kTripped;
      before = mode;
    }
  }
  EXPECT_GT(trips, 100);
  EXPECT_GT(restarts, 100);
  EXPECT_GT(overloads, 2) << "first starts only";
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
