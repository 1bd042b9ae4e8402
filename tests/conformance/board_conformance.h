// One suite for every backend of hal/board.h. Each backend supplies a World, the other end of its wires:
//
//   using BoardType                       satisfies hal::Board
//   BoardType& board()
//   void send(const WorldTick&)           gives one tick's inputs to the board, without waiting
//   void send_sensors_only(Sensors)       gives a tick without the monitor's verdict
//   bool receive(StepCommand&, ControllerStatus&)   the board's outputs since the last call; false: none came
//   hal::LinkCounters counters()
//   std::int64_t watchdog_kicks()
//   void expect_silence(Status)           checks how the backend reports that nothing came after a tick
//   void expect_no_verdict(Status)        checks how it reports that only the verdict did not come
//   kSinglePrecision                      optional, true: a board whose model has floats
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "hal/control_loop.h"
#include "tests/conformance/random_message.h"
#include "tests/random_seed.h"

namespace ballast::hal::test {

struct WorldTick {
  firmware::Sensors sensors;
  firmware::MonitorVerdict verdict;
  std::vector<firmware::OperatorInput> commands;
  bool last = false;
};

inline constexpr std::int64_t kScenarioId = 0x5ca1ab1e0ddba11;
inline constexpr double kControlPeriod_s = 0.001;
inline constexpr int kMassCount = 3;

// Whether the model on the other side of a World has floats.
template <class World>
constexpr bool is_single_precision() {
  if constexpr (requires { World::kSinglePrecision; }) return World::kSinglePrecision;
  return false;
}

inline firmware::Sensors random_sensors(std::mt19937_64& random, std::int64_t tick) {
  auto sensors = random_message<firmware::Sensors>(random);
  sensors.tick = tick;
  return sensors;
}
inline firmware::StepCommand random_steps(std::mt19937_64& random, std::int64_t tick) {
  auto steps = random_message<firmware::StepCommand>(random);
  steps.tick = tick;
  return steps;
}
inline firmware::ControllerStatus random_status(std::mt19937_64& random, std::int64_t tick) {
  auto status = random_message<firmware::ControllerStatus>(random);
  status.tick = tick;
  return status;
}

inline WorldTick world_tick(std::int64_t tick, std::vector<firmware::OperatorInput> commands = {}, bool last = false) {
  WorldTick t;
  t.sensors.tick = tick;
  t.verdict.tick = tick;
  t.commands = std::move(commands);
  t.last = last;
  return t;
}

// Parameters the firmware accepts: masses at rest on lines.
inline std::unique_ptr<firmware::ControllerParams> resting_robot() {
  auto params = std::make_unique<firmware::ControllerParams>();
  params->scenario_id = kScenarioId;
  params->control_period_s = kControlPeriod_s;
  params->timer_frequency_hz = 1e7;
  params->static_friction = 0.3;
  params->sensor_stale_ticks = 1;
  params->monitor_stale_ticks = 1;
  params->ball.radius_m = 1;
  params->ball.gravity_mps2 = 9.81;
  params->ball.shell_mass_kg = 1;
  params->ball.inertia_kgm2 = firmware::Vector3(0.9, 1.0, 1.1);
  params->ball.mass_count = kMassCount;
  for (std::size_t i = 0; i < kMassCount; ++i) {
    params->ball.mass_kg[i] = 1;
    params->ball.rail[i] = firmware::line(firmware::Vector3(0, 0, -0.1), firmware::Vector3::Unit(static_cast<int>(i)));
    params->motor[i] = {.steps_per_unit = 1000, .max_step_rate_hz = 1e4, .max_acceleration = 1, .max_jerk = 10};
  }
  EXPECT_TRUE(firmware::validate(*params).ok());
  return params;
}

template <class World>
class BoardConformance : public ::testing::Test {
 protected:
  void SetUp() override {
    seed_ = ballast::test::random_seed();
    random_.seed(seed_);
    RecordProperty("seed", std::to_string(seed_));
  }

  // Sends a tick and expects the board to hand it out.
  void serve(const WorldTick& tick) {
    world_.send(tick);
    std::int64_t number = -99;
    ASSERT_EQ(board_.wait_tick(number), Status::kOk);
    EXPECT_EQ(number, tick.sensors.tick);
  }

  World world_;
  typename World::BoardType& board_ = world_.board();
  std::uint64_t seed_ = 0;
  std::mt19937_64 random_;
};

TYPED_TEST_SUITE_P(BoardConformance);

TYPED_TEST_P(BoardConformance, TicksComeInOrderAndOnce) {
  for (std::int64_t tick = -2; tick < 20; ++tick) {
    ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(tick)));
    firmware::Sensors sensors;
    firmware::MonitorVerdict verdict;
    EXPECT_EQ(this->board_.read_sensors(sensors), Status::kOk);
    EXPECT_EQ(this->board_.read_verdict(verdict), Status::kOk);
    EXPECT_EQ(sensors.tick, tick);
    EXPECT_EQ(verdict.tick, tick);
  }
  const LinkCounters counters = this->world_.counters();
  EXPECT_EQ(counters.repeated + counters.out_of_order + counters.malformed + counters.foreign, 0);
}

TYPED_TEST_P(BoardConformance, FirstTickMayHaveAnyNumber) {
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(123456789012345)));
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(123456789012346)));
}

TYPED_TEST_P(BoardConformance, SensorsArriveBitForBit) {
  for (std::int64_t tick = 0; tick < 50; ++tick) {
    WorldTick t = world_tick(tick);
    t.sensors = random_sensors(this->random_, tick);
    ASSERT_NO_FATAL_FAILURE(this->serve(t));
    firmware::Sensors sensors;
    ASSERT_EQ(this->board_.read_sensors(sensors), Status::kOk);
    expect_same(sensors, t.sensors, is_single_precision<TypeParam>());
  }
}

TYPED_TEST_P(BoardConformance, NanInSensorsReachesTheFirmware) {
  WorldTick t = world_tick(0);
  t.sensors.gyro_B_radps[1] = std::numeric_limits<double>::quiet_NaN();
  ASSERT_NO_FATAL_FAILURE(this->serve(t));
  firmware::Sensors sensors;
  ASSERT_EQ(this->board_.read_sensors(sensors), Status::kOk);
  expect_same(sensors, t.sensors, is_single_precision<TypeParam>());
  EXPECT_EQ(this->world_.counters().malformed, 0);
}

TYPED_TEST_P(BoardConformance, SensorsAndVerdictAreReadOnce) {
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(5)));
  firmware::Sensors sensors;
  firmware::MonitorVerdict verdict;
  ASSERT_EQ(this->board_.read_sensors(sensors), Status::kOk);
  ASSERT_EQ(this->board_.read_verdict(verdict), Status::kOk);
  sensors.tick = verdict.tick = -77;
  EXPECT_EQ(this->board_.read_sensors(sensors), Status::kEmpty);
  EXPECT_EQ(this->board_.read_verdict(verdict), Status::kEmpty);
  EXPECT_EQ(sensors.tick, -77);
  EXPECT_EQ(verdict.tick, -77);
}

TYPED_TEST_P(BoardConformance, VerdictPasses) {
  for (std::int64_t tick = 0; tick < 4; ++tick) {
    WorldTick t = world_tick(tick);
    t.verdict.tripped = tick >= 2;
    ASSERT_NO_FATAL_FAILURE(this->serve(t));
    firmware::MonitorVerdict verdict;
    ASSERT_EQ(this->board_.read_verdict(verdict), Status::kOk);
    EXPECT_EQ(verdict.tick, tick);
    EXPECT_EQ(verdict.tripped, tick >= 2);
  }
}

TYPED_TEST_P(BoardConformance, OperatorIsObeyedOnceAndInOrder) {
  using enum firmware::OperatorCommand;
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(0, {kArm, kStart, kReset, kStart, kArm})));
  for (const firmware::OperatorCommand expected : {kArm, kStart, kReset}) {
    firmware::OperatorInput command = kNone;
    EXPECT_EQ(this->board_.read_operator(command), Status::kOk);
    EXPECT_EQ(command.command, expected);
  }
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(1)));  // the rest waits
  for (const firmware::OperatorCommand expected : {kStart, kArm}) {
    firmware::OperatorInput command = kNone;
    EXPECT_EQ(this->board_.read_operator(command), Status::kOk);
    EXPECT_EQ(command.command, expected);
  }
  firmware::OperatorInput command = kNone;
  EXPECT_EQ(this->board_.read_operator(command), Status::kEmpty);
  EXPECT_EQ(command.command, kNone);
  EXPECT_EQ(this->world_.counters().dropped, 0);
}

TYPED_TEST_P(BoardConformance, AStopGoesFirstAndTakesBackWhatWaits) {
  using enum firmware::OperatorCommand;
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(0, {kArm, kStart, kReset, kStart, kArm, kReset, kReset, kReset})));
  // The queue of the smallest board is full.
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(1, {kStop, kReset, kArm})));
  for (const firmware::OperatorCommand expected : {kStop, kReset, kArm}) {
    firmware::OperatorInput command = kNone;
    EXPECT_EQ(this->board_.read_operator(command), Status::kOk);
    EXPECT_EQ(command.command, expected);
  }
  firmware::OperatorInput command = kNone;
  EXPECT_EQ(this->board_.read_operator(command), Status::kEmpty);
  EXPECT_EQ(this->world_.counters().dropped, 8);
}

TYPED_TEST_P(BoardConformance, MovesArriveBitForBit) {
  for (std::int64_t tick = 0; tick < 20; ++tick) {
    const auto move = random_message<firmware::MoveRequest>(this->random_);  // the firmware judges it
    ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(tick, {move})));
    firmware::OperatorInput input;
    ASSERT_EQ(this->board_.read_operator(input), Status::kOk);
    EXPECT_EQ(input.command, firmware::OperatorCommand::kMove);
    expect_same(input.move, move);
  }
}

TYPED_TEST_P(BoardConformance, StepsAndStatusArriveBitForBit) {
  for (std::int64_t tick = 0; tick < 50; ++tick) {
    ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(tick)));
    firmware::StepCommand steps = random_steps(this->random_, tick + 1);
    if (tick == 0) {
      while (steps.burst_count < firmware::kMaxBursts) steps = random_steps(this->random_, tick + 1);
    }
    const firmware::ControllerStatus status = random_status(this->random_, tick);
    ASSERT_EQ(this->board_.write_steps(steps), Status::kOk);
    ASSERT_EQ(this->board_.write_status(status), Status::kOk);
    firmware::StepCommand steps_received;
    firmware::ControllerStatus status_received;
    ASSERT_TRUE(this->world_.receive(steps_received, status_received));
    expect_same(steps_received, steps);
    expect_same(status_received, status, is_single_precision<TypeParam>());
  }
}

TYPED_TEST_P(BoardConformance, EndIsReportedAfterTheLastTickWasServed) {
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(0)));
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(1, {}, true)));
  firmware::Sensors sensors;
  EXPECT_EQ(this->board_.read_sensors(sensors), Status::kOk);
  std::int64_t tick = -99;
  EXPECT_EQ(this->board_.wait_tick(tick), Status::kEnded);
  EXPECT_EQ(this->board_.wait_tick(tick), Status::kEnded);
  EXPECT_EQ(tick, -99);
}

TYPED_TEST_P(BoardConformance, RepeatedTickIsIgnoredAndCounted) {
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(0)));
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(1)));
  this->world_.send(world_tick(1));
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(2)));
  EXPECT_GE(this->world_.counters().repeated, 1);
  EXPECT_EQ(this->world_.counters().out_of_order, 0);
}

TYPED_TEST_P(BoardConformance, TickOutOfOrderIsIgnoredAndCounted) {
  for (std::int64_t tick = 0; tick < 3; ++tick) ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(tick)));
  this->world_.send(world_tick(0));
  this->world_.send(world_tick(7));
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(3)));
  EXPECT_GE(this->world_.counters().out_of_order, 2);
  EXPECT_EQ(this->world_.counters().repeated, 0);
}

TYPED_TEST_P(BoardConformance, SilenceIsReported) {
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(0)));
  std::int64_t tick = -99;
  this->world_.expect_silence(this->board_.wait_tick(tick));
  EXPECT_EQ(tick, -99);
}

TYPED_TEST_P(BoardConformance, MissingVerdictIsReported) {
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(0)));
  firmware::MonitorVerdict verdict;
  ASSERT_EQ(this->board_.read_verdict(verdict), Status::kOk);
  firmware::Sensors sensors;
  sensors.tick = 1;
  this->world_.send_sensors_only(sensors);
  std::int64_t tick = -99;
  this->world_.expect_no_verdict(this->board_.wait_tick(tick));
}

// The real firmware runs on this board: each tick is served once, its outputs carry the right tick, and one command is
// obeyed per tick.
TYPED_TEST_P(BoardConformance, ControlLoopServesTheFirmware) {
  using enum firmware::OperatorCommand;
  const auto params = resting_robot();
  const auto loop = std::make_unique<ControlLoop<typename TypeParam::BoardType>>(*params, this->board_);
  for (std::int64_t tick = -2; tick <= 10; ++tick) {
    WorldTick t = world_tick(tick, {}, tick == 10);
    if (tick == -2) t.commands = {kArm, kStart};
    if (tick == 6) t.sensors.gyro_B_radps[0] = std::numeric_limits<double>::quiet_NaN();
    this->world_.send(t);
    ASSERT_EQ(loop->step(), Status::kOk);
    firmware::StepCommand steps;
    firmware::ControllerStatus status;
    ASSERT_TRUE(this->world_.receive(steps, status));
    EXPECT_EQ(status.tick, tick);
    EXPECT_EQ(status.scenario_id, kScenarioId);
    EXPECT_EQ(steps.tick, tick + 1);
    EXPECT_EQ(status.motor_count, kMassCount);
    if (tick < 6) {
      EXPECT_EQ(status.mode, tick == -2 ? firmware::Mode::kArmed : firmware::Mode::kRunning);
    }
    const bool nan_seen = (status.faults & static_cast<std::uint32_t>(firmware::Fault::kSensorNotFinite)) != 0;
    EXPECT_EQ(nan_seen, tick >= 6);
  }
  EXPECT_EQ(loop->run(), Status::kEnded);
  EXPECT_EQ(this->world_.watchdog_kicks(), 13);
}

REGISTER_TYPED_TEST_SUITE_P(BoardConformance, TicksComeInOrderAndOnce, FirstTickMayHaveAnyNumber,
                            SensorsArriveBitForBit, NanInSensorsReachesTheFirmware, SensorsAndVerdictAreReadOnce,
                            VerdictPasses, OperatorIsObeyedOnceAndInOrder, AStopGoesFirstAndTakesBackWhatWaits,
                            MovesArriveBitForBit, StepsAndStatusArriveBitForBit, EndIsReportedAfterTheLastTickWasServed,
                            RepeatedTickIsIgnoredAndCounted, TickOutOfOrderIsIgnoredAndCounted, SilenceIsReported,
                            MissingVerdictIsReported, ControlLoopServesTheFirmware);

}  // namespace ballast::hal::test
