// One suite for every backend of hal/board.h. A backend is tested by giving it a World, the other end of the wires:
//
//   using BoardType                       satisfies hal::Board
//   BoardType& board()
//   void send(const WorldTick&)           hands one tick's inputs to the board, without waiting
//   void send_sensors_only(Sensors)       a tick of which the monitor's verdict does not come
//   bool receive(StepCommand&, ControllerStatus&)   what the board has written since the last call; false: nothing came
//   hal::LinkCounters counters()
//   std::int64_t watchdog_kicks()
//   void expect_silence(Status)           checks how the backend reports that nothing at all came after a tick
//   void expect_no_verdict(Status)        and that only the verdict did not come
//   kSinglePrecision                      optional, true: a board whose model has floats
#pragma once

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "hal/control_loop.h"

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

inline std::uint64_t bits(double value) { return std::bit_cast<std::uint64_t>(value); }

// Any 64 bits: every kind of number, infinities and (quiet, as signalling ones may be quieted by any move) NaNs.
inline double any_double(std::mt19937_64& random) {
  const std::uint64_t pattern = random();
  const double value = std::bit_cast<double>(pattern);
  return value == value ? value : std::bit_cast<double>(pattern | 0x8000000000000ull);
}

// A number of the model as it is at the other side of the board: rounded once on one with single precision, where a NaN
// stays one without its bits.
template <class World>
void pass(double& value) {
  if constexpr (requires { requires World::kSinglePrecision; }) {
    value = value == value ? static_cast<double>(static_cast<float>(value)) : std::numeric_limits<double>::quiet_NaN();
  }
}

template <class World>
firmware::Sensors passed(firmware::Sensors sensors) {
  for (double& q : sensors.orientation.coeffs()) pass<World>(q);
  for (double& rate : sensors.gyro_B_radps) pass<World>(rate);
  for (double& acceleration : sensors.accelerometer_B_mps2) pass<World>(acceleration);
  return sensors;
}

template <class World>
firmware::ControllerStatus passed(firmware::ControllerStatus status) {
  for (double& position : status.commanded_position) pass<World>(position);
  for (double& velocity : status.commanded_velocity) pass<World>(velocity);
  for (double* value :
       {&status.predicted.normal_force_n, &status.predicted.static_friction_n, &status.mu_required, &status.margin,
        &status.plan.normal_force_min_n, &status.plan.mu_required_max, &status.plan.margin_min}) {
    pass<World>(*value);
  }
  return status;
}

inline firmware::Sensors random_sensors(std::mt19937_64& random, std::int64_t tick) {
  firmware::Sensors sensors;
  sensors.tick = tick;
  for (double& q : sensors.orientation.coeffs()) q = any_double(random);
  for (int j = 0; j < 3; ++j) {
    sensors.gyro_B_radps[j] = any_double(random);
    sensors.accelerometer_B_mps2[j] = any_double(random);
  }
  for (std::size_t i = 0; i < kMassCount; ++i) sensors.limit_switch[i] = static_cast<std::uint8_t>(random() % 4);
  return sensors;
}

inline void expect_same(const firmware::Sensors& a, const firmware::Sensors& b) {
  EXPECT_EQ(a.tick, b.tick);
  for (int j = 0; j < 4; ++j) EXPECT_EQ(bits(a.orientation.coeffs()[j]), bits(b.orientation.coeffs()[j]));
  for (int j = 0; j < 3; ++j) {
    EXPECT_EQ(bits(a.gyro_B_radps[j]), bits(b.gyro_B_radps[j]));
    EXPECT_EQ(bits(a.accelerometer_B_mps2[j]), bits(b.accelerometer_B_mps2[j]));
  }
  EXPECT_EQ(a.limit_switch, b.limit_switch);
}

inline firmware::StepCommand random_steps(std::mt19937_64& random, std::int64_t tick, int burst_count) {
  const auto any_int = [&random] { return static_cast<std::int32_t>(random()); };
  firmware::StepCommand steps;
  steps.tick = tick;
  steps.motor_count = kMassCount;
  for (std::size_t i = 0; i < kMassCount; ++i) {
    steps.steps[i] = any_int();
    steps.position_steps[i] = static_cast<std::int64_t>(random());
  }
  steps.burst_count = burst_count;
  for (std::size_t i = 0; i < static_cast<std::size_t>(burst_count); ++i) {
    firmware::StepBurst& burst = steps.bursts[i];
    burst.motor = static_cast<std::uint8_t>(random() % kMassCount);
    burst.direction = random() % 2 == 0 ? 1 : -1;
    burst.count = static_cast<std::int16_t>(1 + random() % 32767);
    burst.first_ticks = any_int() & 0x7fffffff;
    burst.interval_ticks = any_int() & 0x7fffffff;
    burst.add_ticks = any_int();
  }
  return steps;
}

inline void expect_same(const firmware::StepCommand& a, const firmware::StepCommand& b) {
  EXPECT_EQ(a.tick, b.tick);
  EXPECT_EQ(a.motor_count, b.motor_count);
  EXPECT_EQ(a.steps, b.steps);
  EXPECT_EQ(a.position_steps, b.position_steps);
  ASSERT_EQ(a.burst_count, b.burst_count);
  for (std::size_t i = 0; i < static_cast<std::size_t>(a.burst_count); ++i) {
    EXPECT_EQ(a.bursts[i].motor, b.bursts[i].motor);
    EXPECT_EQ(a.bursts[i].direction, b.bursts[i].direction);
    EXPECT_EQ(a.bursts[i].count, b.bursts[i].count);
    EXPECT_EQ(a.bursts[i].first_ticks, b.bursts[i].first_ticks);
    EXPECT_EQ(a.bursts[i].interval_ticks, b.bursts[i].interval_ticks);
    EXPECT_EQ(a.bursts[i].add_ticks, b.bursts[i].add_ticks);
  }
}

inline firmware::ControllerStatus random_status(std::mt19937_64& random, std::int64_t tick) {
  firmware::ControllerStatus status;
  status.tick = tick;
  status.scenario_id = kScenarioId;
  status.mode = static_cast<firmware::Mode>(random() % 6);
  status.at_rest = random() % 2 == 0;
  status.faults = static_cast<std::uint32_t>(random());
  status.motor_count = kMassCount;
  for (std::size_t i = 0; i < kMassCount; ++i) {
    status.commanded_position[i] = any_double(random);
    status.commanded_velocity[i] = any_double(random);
    status.next[i] = {any_double(random), any_double(random), any_double(random)};
    status.steps_issued[i] = static_cast<std::int64_t>(random());
  }
  status.predicted.normal_force_n = any_double(random);
  status.predicted.static_friction_n = any_double(random);
  status.mu_required = std::numeric_limits<double>::infinity();
  status.margin = any_double(random);
  status.overruns = static_cast<std::int64_t>(random());
  status.overload = {{static_cast<firmware::StepError>(random() % 4), any_double(random), any_double(random)},
                     static_cast<int>(random() % 9) - 1,
                     static_cast<std::int64_t>(random() >> 3)};
  status.operator_commands = static_cast<std::int64_t>(random());
  status.refusal = {static_cast<firmware::Refusal>(random() % 11), static_cast<int>(random() % 9) - 1,
                    static_cast<int>(random() % 130) - 1, any_double(random)};
  status.planned = random() % 2 == 0;
  status.plan_tick = static_cast<std::int64_t>(random() >> 3);
  status.plan = {any_double(random), any_double(random), any_double(random), any_double(random), any_double(random)};
  return status;
}

inline void expect_same(const firmware::ControllerStatus& a, const firmware::ControllerStatus& b) {
  EXPECT_EQ(a.tick, b.tick);
  EXPECT_EQ(a.scenario_id, b.scenario_id);
  EXPECT_EQ(a.mode, b.mode);
  EXPECT_EQ(a.at_rest, b.at_rest);
  EXPECT_EQ(a.faults, b.faults);
  EXPECT_EQ(a.motor_count, b.motor_count);
  for (std::size_t i = 0; i < firmware::kMaxMasses; ++i) {
    EXPECT_EQ(bits(a.commanded_position[i]), bits(b.commanded_position[i]));
    EXPECT_EQ(bits(a.commanded_velocity[i]), bits(b.commanded_velocity[i]));
    EXPECT_EQ(bits(a.next[i].position), bits(b.next[i].position));
    EXPECT_EQ(bits(a.next[i].velocity), bits(b.next[i].velocity));
    EXPECT_EQ(bits(a.next[i].acceleration), bits(b.next[i].acceleration));
  }
  EXPECT_EQ(a.steps_issued, b.steps_issued);
  EXPECT_EQ(bits(a.predicted.normal_force_n), bits(b.predicted.normal_force_n));
  EXPECT_EQ(bits(a.predicted.static_friction_n), bits(b.predicted.static_friction_n));
  EXPECT_EQ(bits(a.mu_required), bits(b.mu_required));
  EXPECT_EQ(bits(a.margin), bits(b.margin));
  EXPECT_EQ(a.overruns, b.overruns);
  EXPECT_EQ(a.overload.trouble.error, b.overload.trouble.error);
  EXPECT_EQ(bits(a.overload.trouble.value), bits(b.overload.trouble.value));
  EXPECT_EQ(bits(a.overload.trouble.limit), bits(b.overload.trouble.limit));
  EXPECT_EQ(a.overload.motor, b.overload.motor);
  EXPECT_EQ(a.overload.tick, b.overload.tick);
  EXPECT_EQ(a.operator_commands, b.operator_commands);
  EXPECT_EQ(a.refusal.reason, b.refusal.reason);
  EXPECT_EQ(a.refusal.motor, b.refusal.motor);
  EXPECT_EQ(a.refusal.piece, b.refusal.piece);
  EXPECT_EQ(bits(a.refusal.value), bits(b.refusal.value));
  EXPECT_EQ(a.planned, b.planned);
  EXPECT_EQ(a.plan_tick, b.plan_tick);
  EXPECT_EQ(bits(a.plan.duration_s), bits(b.plan.duration_s));
  EXPECT_EQ(bits(a.plan.horizon_s), bits(b.plan.horizon_s));
  EXPECT_EQ(bits(a.plan.normal_force_min_n), bits(b.plan.normal_force_min_n));
  EXPECT_EQ(bits(a.plan.mu_required_max), bits(b.plan.mu_required_max));
  EXPECT_EQ(bits(a.plan.margin_min), bits(b.plan.margin_min));
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
    params->motor[i] = {.steps_per_unit = 1000, .max_step_rate_hz = 1e5, .max_acceleration = 1, .max_jerk = 10};
  }
  EXPECT_TRUE(firmware::validate(*params).ok());
  return params;
}

template <class World>
class BoardConformance : public ::testing::Test {
 protected:
  void SetUp() override {
    std::random_device device;
    seed_ = device();
    random_.seed(seed_);
    RecordProperty("seed", std::to_string(seed_));
  }
  void TearDown() override {
    if (this->HasFailure()) std::printf("seed %llu\n", static_cast<unsigned long long>(seed_));
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
    expect_same(passed<TypeParam>(sensors), passed<TypeParam>(t.sensors));
  }
}

TYPED_TEST_P(BoardConformance, NanInSensorsReachesTheFirmware) {
  WorldTick t = world_tick(0);
  t.sensors.gyro_B_radps[1] = std::numeric_limits<double>::quiet_NaN();
  ASSERT_NO_FATAL_FAILURE(this->serve(t));
  firmware::Sensors sensors;
  ASSERT_EQ(this->board_.read_sensors(sensors), Status::kOk);
  expect_same(passed<TypeParam>(sensors), passed<TypeParam>(t.sensors));
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
  ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(1)));  // what is left over waits
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
    firmware::MoveRequest move;
    move.masses = static_cast<std::uint32_t>(this->random_());  // judging it is the firmware's business too
    for (double& target : move.target_position) target = any_double(this->random_);
    move.speed_fraction = any_double(this->random_);
    ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(tick, {move})));
    firmware::OperatorInput input;
    ASSERT_EQ(this->board_.read_operator(input), Status::kOk);
    EXPECT_EQ(input.command, firmware::OperatorCommand::kMove);
    EXPECT_EQ(input.move.masses, move.masses);
    for (std::size_t i = 0; i < firmware::kMaxMasses; ++i) {
      EXPECT_EQ(bits(input.move.target_position[i]), bits(move.target_position[i]));
    }
    EXPECT_EQ(bits(input.move.speed_fraction), bits(move.speed_fraction));
  }
}

TYPED_TEST_P(BoardConformance, StepsAndStatusArriveBitForBit) {
  for (std::int64_t tick = 0; tick < 50; ++tick) {
    ASSERT_NO_FATAL_FAILURE(this->serve(world_tick(tick)));
    const int burst_count =
        tick == 0 ? firmware::kMaxBursts : static_cast<int>(this->random_() % (firmware::kMaxBursts + 1));
    const firmware::StepCommand steps = random_steps(this->random_, tick + 1, burst_count);
    const firmware::ControllerStatus status = random_status(this->random_, tick);
    ASSERT_EQ(this->board_.write_steps(steps), Status::kOk);
    ASSERT_EQ(this->board_.write_status(status), Status::kOk);
    firmware::StepCommand steps_received;
    firmware::ControllerStatus status_received;
    ASSERT_TRUE(this->world_.receive(steps_received, status_received));
    expect_same(steps_received, steps);
    expect_same(passed<TypeParam>(status_received), passed<TypeParam>(status));
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

// The real firmware on this board: each tick served once, its outputs under the right tick, commands obeyed one per
// tick.
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
