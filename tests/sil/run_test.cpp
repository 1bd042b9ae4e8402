// The lap as a whole, in one process: firmware, plant and monitor on the shipped robots.
#include "tools/sil/run.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <map>

#include "tests/sil/kept_laps.h"
#include "tests/sil/shell.h"
#include "tools/faults/full_disk.h"
#include "tools/program/params.h"
#include "tools/recording/recorder.h"
#include "tools/sil/host_firmware.h"
#include "tools/sil/local_peers.h"
#include "tools/summary/summary.h"

namespace ballast::sil {
namespace {

sim::Scenario load(const std::string& name, const std::vector<std::string>& overrides = {}) {
  const auto result = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides);
  for (const auto& error : result.errors) ADD_FAILURE() << to_string(error);
  return result.scenario;
}

RunResult run_scenario(const sim::Scenario& scenario, const std::string& log = "/dev/null") {
  auto params = std::make_unique<firmware::ControllerParams>();
  const bool stepper = scenario.run.actuation == sim::Actuation::kStepper;
  if (stepper) {
    const auto refusal = program::to_controller_params(scenario, *params);
    EXPECT_FALSE(refusal) << *refusal;
  }
  InProcessPeers peers(stepper ? params.get() : nullptr, program::to_monitor_limits(scenario),
                       scenario.run.control_period_s);
  Recorder recorder(log);
  RunResult result = run(scenario, peers, recorder, {});
  EXPECT_EQ(result.status, hal::Status::kOk) << result.trouble;
  EXPECT_TRUE(recorder.close());
  return result;
}

// Stiff, heavy motors with fine steps, balanced so that the ripple (torque per microstep over inertia) falls as the
// microstep.
std::vector<std::string> ideal_motors(int microsteps) {
  std::vector<std::string> overrides;
  for (int i = 0; i < 3; ++i) {
    const std::string motor = "mass." + std::to_string(i) + ".motor.";
    overrides.push_back(motor + "microsteps=" + std::to_string(microsteps));
    overrides.push_back(motor + "step_error=0");
  }
  return overrides;
}

// The same story within the ripple, for 1/16 and 1/256 steps; the bars are what the motors' lag
// leaves.
TEST(StepperRun, TellsThePrescribedRunsStory) {
  const RunResult prescribed = run_scenario(load("paper_ball", {"run.actuation=prescribed"}));
  for (const int microsteps : {16, 256}) {
    SCOPED_TRACE(microsteps);
    const RunResult stepper = run_scenario(load("paper_ball", ideal_motors(microsteps)));
    EXPECT_EQ(stepper.end_reason, EndReason::kCompleted);
    // Lag of the motors: asin(load / holding torque) / 50 teeth, up to 7e-3 rad, is what the final position feels.
    EXPECT_LT((stepper.final_sample.position_W_m - prescribed.final_sample.position_W_m).norm(), 0.02);
    // A microstep changes the torque by 12 N m * 2 pi / (4 * microsteps) and so shakes 5.9 kg m^2 by 1.2e-1 (1/16)
    // or 1.2e-2 (1/256) rad/s^2 in turn on three masses: 0.2 and 0.02 of force on N = 4. The motors' own ringing comes
    // on top.
    EXPECT_NEAR(stepper.extrema.mu_required_max.value, prescribed.extrema.mu_required_max.value,
                microsteps == 16 ? 0.05 : 0.01);
    EXPECT_EQ(stepper.final_sample.lost_steps[0], 0);
    // The counters end where the profile does, to half a microstep.
    const double commanded = prescribed.final_sample.mass_position[0] * 200 * microsteps / (2 * M_PI);
    EXPECT_NEAR(static_cast<double>(stepper.motors[0].steps), commanded, 0.5 + 1e-6);
  }
}

struct Heard {
  std::vector<std::vector<int>> steps;  // of the commands, tick by tick
  std::vector<int> modes, faults;       // of the controller
  std::vector<double> mu_required;      // the plant's truth
};

Heard listen(const std::string& path) {
  Heard heard;
  lcm::LogFile log(path, "r");
  while (const auto* event = log.readNextEvent()) {
    step_command_t command;
    controller_status_t status;
    contact_t contact{};
    if (event->channel == hal::kChannelStepCommand && command.decode(event->data, 0, event->datalen) > 0) {
      heard.steps.emplace_back(command.steps, command.steps + command.motor_count);
    } else if (event->channel == hal::kChannelControllerStatus && status.decode(event->data, 0, event->datalen) > 0) {
      heard.modes.push_back(status.mode);
      heard.faults.push_back(status.faults);
    } else if (event->channel == hal::kChannelContact && contact.decode(event->data, 0, event->datalen) > 0) {
      heard.mu_required.push_back(contact.mu_required);
    }
  }
  return heard;
}

// A motor too weak for its mass loses steps. They are counted against the rotor's true angle; the controller, which has
// no sensor for that, goes on as if nothing had happened; the ball moves otherwise, and the monitor sees that.
TEST(StepperRun, AWeakMotorLosesStepsBehindTheControllersBack) {
  const std::string folder = testing::TempDir();
  // The mass at 30 degrees of its ring needs 0.28 kg * 9.81 * 0.095 m / 2 / 4 = 0.033 N m of its motor.
  const std::vector<std::string> weak{"mass.0.motor.holding_torque=0.03", "mass.0.motor.detent_torque=0"};
  const auto good = run_scenario(load("desk_ball", {}), folder + "good.lcmlog");
  const auto bad = run_scenario(load("desk_ball", weak), folder + "bad.lcmlog");
  ASSERT_EQ(good.end_reason, EndReason::kCompleted);
  ASSERT_EQ(bad.end_reason, EndReason::kCompleted);
  const Heard strong = listen(folder + "good.lcmlog"), slipping = listen(folder + "bad.lcmlog");

  // Commanded by the pulses sent, all one way; true by where the mass is; both from theta = 0.
  const double per_rad = 200 * 16 * 4 / (2 * M_PI);
  const double behind = static_cast<double>(bad.motors[0].steps) - bad.final_sample.mass_position[0] * per_rad;
  EXPECT_NEAR(bad.motors[0].steps_behind, behind, 1e-6);
  EXPECT_GT(bad.final_sample.lost_steps[0], 1000);
  EXPECT_EQ(bad.final_sample.lost_steps[0], 64 * std::llround(behind / 64));
  EXPECT_GE(bad.motors[0].slips * 64, bad.final_sample.lost_steps[0]);
  EXPECT_LT(bad.motor_extrema[0].torque_margin, 0);
  EXPECT_EQ(good.final_sample.lost_steps[0], 0);

  EXPECT_EQ(strong.steps, slipping.steps);
  EXPECT_EQ(strong.modes, slipping.modes);
  EXPECT_EQ(strong.faults, slipping.faults);
  EXPECT_NE(strong.mu_required, slipping.mu_required);

  // The same, with a limit a little below what the ball then needs.
  double most = 0;
  for (const double mu : slipping.mu_required) most = std::max(most, mu);
  const double use = 0.9 * most / 0.5;
  auto limited = weak;
  limited.push_back("envelope.friction_use=" + std::to_string(use));
  const auto tripped = run_scenario(load("desk_ball", limited));
  EXPECT_NE(tripped.trip.tripped, 0);
  EXPECT_EQ(tripped.trip.cause, trip_t::CAUSE_FRICTION);
  // The value is what the plant's own contact said: in the tick in which it first passed the limit.
  EXPECT_GT(tripped.trip.value, use * 0.5);
  EXPECT_LE(tripped.trip.value, bad.extrema.mu_required_max.value);
}

// Every channel's messages, in order, with their tick.
std::map<std::string, std::vector<std::int64_t>> ticks_in(const std::string& path) {
  std::map<std::string, std::vector<std::int64_t>> ticks;
  lcm::LogFile log(path, "r");
  while (const auto* event = log.readNextEvent()) {
    // Every message starts with its 8 bytes of hash, then the tick, big-endian.
    std::int64_t tick = 0;
    for (int i = 8; i < 16; ++i) tick = (tick << 8) | static_cast<unsigned char*>(event->data)[i];
    ticks[event->channel].push_back(tick);
  }
  return ticks;
}

TEST(Log, HoldsEveryChannelAtEveryTick) {
  const std::string path = testing::TempDir() + "log_test.lcmlog";
  run_scenario(load("paper_ball", {"duration=0.25"}), path);
  const auto ticks = ticks_in(path);
  ASSERT_EQ(ticks.size(), 7u);
  for (const char* channel : {hal::kChannelContact, hal::kChannelPlantState, hal::kChannelSensors, hal::kChannelTrip,
                              hal::kChannelControllerStatus}) {
    const auto& list = ticks.at(channel);
    ASSERT_EQ(list.size(), 253u) << channel;  // two countdown ticks, then 0..250
    for (std::size_t i = 0; i < list.size(); ++i) ASSERT_EQ(list[i], static_cast<std::int64_t>(i) - 2) << channel;
  }
  const auto& steps = ticks.at(hal::kChannelStepCommand);
  for (std::size_t i = 0; i < steps.size(); ++i) ASSERT_EQ(steps[i], static_cast<std::int64_t>(i) - 1);
  EXPECT_EQ(ticks.at(hal::kChannelOperator), (std::vector<std::int64_t>{-2, -1}));

  run_scenario(load("paper_ball", {"duration=0.25", "run.actuation=prescribed"}), path);
  const auto prescribed = ticks_in(path);
  EXPECT_EQ(prescribed.size(), 4u);
  EXPECT_EQ(prescribed.at(hal::kChannelContact).size(), 251u);
  EXPECT_EQ(prescribed.at(hal::kChannelContact).front(), 0);
}

// The firmware's forces from commanded masses are the plant's, if the masses move as commanded: with
// stiff motors, up to their ripple; compared over the log of a run.
TEST(Log, FirmwareEnvelopeFollowsThePlants) {
  const std::string path = testing::TempDir() + "envelope_test.lcmlog";
  run_scenario(load("paper_ball", ideal_motors(256)), path);
  lcm::LogFile log(path, "r");
  std::map<std::int64_t, double> plant, firmware;
  while (const auto* event = log.readNextEvent()) {
    contact_t contact{};
    controller_status_t status;
    const auto size = static_cast<std::size_t>(event->datalen);
    if (hal::decode(event->data, size, contact))
      plant[contact.tick] = contact.normal_force_n;
    else if (hal::decode(event->data, size, status))
      firmware[status.tick] = status.normal_force_n;
  }
  ASSERT_GT(firmware.size(), 20000u);
  double square = 0;
  int count = 0;
  for (const auto& [tick, n] : firmware) {
    if (tick < 1000) continue;  // the motors ring after the push
    square += (n - plant.at(tick)) * (n - plant.at(tick));
    ++count;
  }
  EXPECT_LT(std::sqrt(square / count), 0.05);  // of N = 4: ripple of 0.02 per mass, see above
}

// A peer that answers nothing: the run says so and does not go on.
class Silent : public Peer {
 public:
  hal::Status send(Lap&) override { return hal::Status::kOk; }
  hal::Status receive(Lap&) override { return hal::Status::kPeerLost; }
  std::string trouble() const override { return "nobody there"; }
};

TEST(RunLoop, EndsWithThePeersTrouble) {
  Silent peers;
  Recorder recorder("/dev/null");
  const RunResult result = run(load("paper_ball"), peers, recorder, {});
  EXPECT_EQ(result.status, hal::Status::kPeerLost);
  EXPECT_EQ(result.trouble, "nobody there");
}

TEST(RunLoop, EndsWithTheRecordersTrouble) {
  const auto scenario = load("paper_ball", {"run.actuation=prescribed"});
  InProcessPeers peers(nullptr, program::to_monitor_limits(scenario), scenario.run.control_period_s);
  Recorder recorder("/dev/full");
  const RunResult result = run(scenario, peers, recorder, {});
  EXPECT_EQ(result.status, hal::Status::kIo);
}

// Passes everything on until something happens, and may compute in parallel with the run.
class TakesItsTime : public Peer {
 public:
  TakesItsTime(Peer& peers, const Recorder& recorder, bool in_parallel)
      : peers_(peers), recorder_(recorder), in_parallel_(in_parallel) {}
  hal::Status connect() override { return peers_.connect(); }
  hal::Status send(Lap& lap) override {
    recorded.push_back(recorder_.bytes());
    return lap.tick() == lost_before ? hal::Status::kPeerLost : peers_.send(lap);
  }
  hal::Status receive(Lap& lap) override {
    return lap.tick() == lost_after ? hal::Status::kPeerLost : peers_.receive(lap);
  }
  [[nodiscard]] bool computes_in_parallel() const override { return in_parallel_; }
  std::string trouble() const override { return "lost"; }

  std::int64_t lost_before = -99, lost_after = -99;
  std::vector<std::int64_t> recorded;  // bytes of the log, as each exchange began

 private:
  Peer& peers_;
  const Recorder& recorder_;
  bool in_parallel_;
};

struct HowItEnds {
  const char* name;
  std::int64_t lost_before = -99, lost_after = -99, interrupted_in = -99;
  double disk_full_s = 1e9;
  double speed = 0;
};

// The log, and how much of it there was as each exchange began.
std::pair<std::string, std::vector<std::int64_t>> recorded_by(bool in_parallel, const HowItEnds& end) {
  const test::Folder folder;
  const sim::Scenario scenario = load("paper_ball", {"duration=0.1"});
  auto params = std::make_unique<firmware::ControllerParams>();
  EXPECT_FALSE(program::to_controller_params(scenario, *params));
  InProcessPeers peers(params.get(), program::to_monitor_limits(scenario), scenario.run.control_period_s);
  Recorder recorder(folder / "run.lcmlog");
  sim::Scenario with_fault = scenario;
  with_fault.faults.emplace_back();
  with_fault.faults.back().kind = sim::FaultKind::kDiskFull;
  with_fault.faults.back().time_s = end.disk_full_s;
  FullDisk disk(with_fault, recorder);
  TakesItsTime takes_its_time(peers, recorder, in_parallel);
  takes_its_time.lost_before = end.lost_before;
  takes_its_time.lost_after = end.lost_after;
  volatile std::sig_atomic_t interrupted = 0;
  RunOptions options;
  options.interrupted = &interrupted;
  options.speed = end.speed;
  options.observe = [&](const Lap& lap, const sim::Plant::Sample&) {
    interrupted = lap.plant.contact.tick == end.interrupted_in;
  };
  const RunResult result = run(scenario, takes_its_time, disk, options);
  recorder.close();
  EXPECT_EQ(result.log_bytes, static_cast<std::int64_t>(std::filesystem::file_size(folder / "run.lcmlog"))) << end.name;
  std::ifstream in(folder / "run.lcmlog", std::ios::binary);
  return {std::string(std::istreambuf_iterator<char>(in), {}), takes_its_time.recorded};
}

TEST(RunLoop, WhatIsRecordedWhilePeersComputeIsWhatIsRecordedAtOnce) {
  for (const HowItEnds& end :
       {HowItEnds{.name = "completed"}, HowItEnds{.name = "lost before", .lost_before = 50},
        HowItEnds{.name = "lost after", .lost_after = 50}, HowItEnds{.name = "lost at once", .lost_before = -2},
        HowItEnds{.name = "interrupted", .interrupted_in = 50}, HowItEnds{.name = "disk full", .disk_full_s = 0.05}}) {
    const std::string at_once = recorded_by(false, end).first, meanwhile = recorded_by(true, end).first;
    EXPECT_EQ(at_once.empty(), end.lost_before == -2) << end.name;
    EXPECT_TRUE(at_once == meanwhile) << end.name << ": " << at_once.size() << " bytes, " << meanwhile.size();
  }
}

// A run that sleeps between its ticks records a tick before the sleep, so that watchers are not one tick late.
TEST(RunLoop, ARunAtAPaceRecordsBeforeItSleeps) {
  const auto laps_behind = [](const std::vector<std::int64_t>& recorded) {
    return std::count(recorded.begin(), recorded.end(), 0);
  };
  EXPECT_EQ(laps_behind(recorded_by(true, {.name = "as fast as it goes"}).second), 2);
  EXPECT_EQ(laps_behind(recorded_by(true, {.name = "at a pace", .speed = 10}).second), 1);
}

TEST(SummaryText, SaysThatAPaceWasNotKept) {
  const sim::Scenario scenario = load("paper_ball", {"duration=1"});
  RunResult result = run_scenario(scenario);
  const auto not_kept = [&](double asked, double wall_s) {
    result.asked_speed = asked;
    result.wall_time_s = wall_s;
    return summary_text(scenario, result, "r").find(" per tick; it was to be 2, which was not kept\n") !=
           std::string::npos;
  };
  EXPECT_FALSE(not_kept(0, 100)) << "none was asked for";
  EXPECT_FALSE(not_kept(2, 0.52)) << "within a twentieth";
  EXPECT_FALSE(not_kept(2, 0.6)) << "a stall that nobody sees";
  EXPECT_TRUE(not_kept(2, 0.8));
}

RunOptions checked() {
  RunOptions options;
  options.check_steps = true;
  return options;
}

// Passes everything on, but one burst of motor 1 comes 2 us late.
class Delays : public Peer {
 public:
  explicit Delays(Peer& peers) : peers_(peers) {}
  hal::Status connect() override { return peers_.connect(); }
  hal::Status send(Lap& lap) override { return peers_.send(lap); }
  hal::Status receive(Lap& lap) override {
    const hal::Status status = peers_.receive(lap);
    step_command_t& steps = lap.answer->steps;
    for (int b = 0; b < steps.burst_count && !late_; ++b) {
      if (steps.motor[b] != 1 || steps.tick < 300) continue;
      late_ = true;
      steps.first[b] += 20;
    }
    return status;
  }
  std::string trouble() const override { return peers_.trouble(); }

 private:
  Peer& peers_;
  bool late_ = false;
};

TEST(RunLoop, APulseInTheWrongPlaceEndsACheckedRun) {
  const auto scenario = load("paper_ball");
  auto params = std::make_unique<firmware::ControllerParams>();
  ASSERT_FALSE(program::to_controller_params(scenario, *params));
  InProcessPeers peers(params.get(), program::to_monitor_limits(scenario), scenario.run.control_period_s);
  Delays delays(peers);
  Recorder recorder("/dev/null");
  const RunResult result = run(scenario, delays, recorder, checked());
  EXPECT_EQ(result.end_reason, EndReason::kStepTiming);
  ASSERT_TRUE(result.step_timing && result.step_timing->violation);
  EXPECT_EQ(result.step_timing->violation_motor, 1);
  EXPECT_GE(result.step_timing->violation->tick, 300);
  EXPECT_LT(result.step_timing->violation->tick, 320);
}

firmware::MoveRequest move_to(std::uint32_t masses, double target, double speed_fraction) {
  firmware::MoveRequest move;
  move.masses = masses;
  move.target_position.fill(target);
  move.speed_fraction = speed_fraction;
  return move;
}

// Passes everything on, but says things as an operator, and may move one burst of a tick by some timer ticks.
class SaysThings : public Peer {
 public:
  SaysThings(Peer& peers, double period_s) : peers_(peers), period_s_(period_s) {}
  hal::Status connect() override { return peers_.connect(); }
  hal::Status send(Lap& lap) override {
    const std::int64_t tick = lap.tick();
    if (const auto said = says.find(tick); said != says.end()) {
      lap.command = hal::to_message(said->second, tick, tick, period_s_);
    }
    return peers_.send(lap);
  }
  hal::Status receive(Lap& lap) override {
    const hal::Status status = peers_.receive(lap);
    modes[lap.answer->status.mode] = lap.tick();
    step_command_t& steps = lap.answer->steps;
    if (moves_tick && !moved && steps.tick >= *moves_tick && steps.burst_count > 0) {
      moved = steps.tick;
      steps.first[0] += moves_by;
    }
    return status;
  }
  std::string trouble() const override { return peers_.trouble(); }

  std::map<std::int64_t, firmware::OperatorInput> says;
  std::map<int, std::int64_t> modes;  // the last tick of each
  std::optional<std::int64_t> moves_tick, moved;
  int moves_by = 0;

 private:
  Peer& peers_;
  double period_s_;
};

// Handwork: moves, the motion begun, stopped and begun again, a move stopped on
// its way. Every pulse has its crossing, those of stops, moves and later starts too.
class ByHand : public testing::Test {
 protected:
  ByHand() : scenario_(load("paper_ball", {"duration=10"})) {
    EXPECT_FALSE(program::to_controller_params(scenario_, *params_));
    peers_.emplace(params_.get(), program::to_monitor_limits(scenario_), scenario_.run.control_period_s);
    hand_.emplace(*peers_, scenario_.run.control_period_s);
    using enum firmware::OperatorCommand;
    hand_->says = {{10, move_to(0b10, 2.1, 0.6)},
                   {1500, kStart},
                   {2033, kStop},
                   {2500, move_to(0b101, 0.3, 0.4)},
                   {3200, kStop},
                   {4000, kStart},
                   {5111, kStop},
                   {6000, kStop},
                   {6010, kArm},
                   {6020, move_to(0b101, 0.35, 1)}};
  }
  RunResult run_it() {
    Recorder recorder("/dev/null");
    RunOptions options = checked();
    options.by_hand = true;
    RunResult result = run(scenario_, *hand_, recorder, options);
    EXPECT_EQ(result.status, hal::Status::kOk) << result.trouble;
    return result;
  }

  sim::Scenario scenario_;
  std::unique_ptr<firmware::ControllerParams> params_ = std::make_unique<firmware::ControllerParams>();
  std::optional<InProcessPeers> peers_;
  std::optional<SaysThings> hand_;
};

TEST_F(ByHand, EveryPulseOfMovesStopsAndLaterStartsIsInItsPlace) {
  const RunResult result = run_it();
  EXPECT_EQ(result.end_reason, EndReason::kCompleted);
  ASSERT_TRUE(result.step_timing);
  const StepTimingRecord& timing = *result.step_timing;
  EXPECT_FALSE(timing.violation) << timing.violation->text();
  std::int64_t checked_steps = 0, unchecked = 0, executed = 0;
  for (const auto& motor : timing.motors) {
    checked_steps += motor.checked_steps;
    unchecked += motor.structural_steps;
    EXPECT_LE(motor.max_error_us, 0.5);
  }
  for (const auto& motor : result.motors) executed += motor.steps;
  EXPECT_EQ(checked_steps, executed);
  EXPECT_EQ(unchecked, 0);
  // The motion makes 0.15 rad/s for 0.43 s and 1.0 s beside its start, on three motors of 509 steps per rad: some 370.
  EXPECT_GT(timing.plan_steps, 300);
  EXPECT_GT(checked_steps - timing.plan_steps, 300);
  EXPECT_LT(hand_->modes[controller_status_t::MODE_MOVING], 10000) << "the last move has come to its end";
  EXPECT_NEAR(static_cast<double>(hand_->modes[controller_status_t::MODE_RUNNING]), 5110, 1);
  ASSERT_TRUE(result.move && result.stop);
  EXPECT_NEAR(result.move->start_s, 6.029, 1e-9);  // said in tick 6020, pending for eight ticks
  EXPECT_NEAR(result.stop->start_s, 5.112, 1e-9);
}

// 11 timer ticks of 0.1 us: one more than from one end of the tolerance to the other. In a move, a stop, a later start
// and the last move.
TEST_F(ByHand, APulseTooLateIsFoundWhereverItIs) {
  for (const std::int64_t tick : {300, 2060, 4300, 6500}) {
    SCOPED_TRACE(tick);
    peers_.emplace(params_.get(), program::to_monitor_limits(scenario_), scenario_.run.control_period_s);
    auto says = hand_->says;
    hand_.emplace(*peers_, scenario_.run.control_period_s);
    hand_->says = says;
    hand_->moves_tick = tick;
    hand_->moves_by = 11;
    const RunResult result = run_it();
    EXPECT_EQ(result.end_reason, EndReason::kStepTiming);
    ASSERT_TRUE(hand_->moved);
    ASSERT_TRUE(result.step_timing->violation);
    EXPECT_EQ(result.step_timing->violation->tick, *hand_->moved);
    EXPECT_EQ(result.step_timing->violation->kind, stepcheck::Kind::kOffTime);
  }
}

// The record names the steps that the controller could not make, with the ticks before them.
TEST(RunLoop, AStepOverloadSaysWhatItWas) {
  const auto scenario = load("paper_ball");
  auto params = std::make_unique<firmware::ControllerParams>();
  ASSERT_FALSE(program::to_controller_params(scenario, *params));
  params->motor[2].max_step_rate_hz = 60;  // the motion needs 76 steps/s
  InProcessPeers peers(params.get(), program::to_monitor_limits(scenario), scenario.run.control_period_s);
  Recorder recorder("/dev/null");
  const RunResult result = run(scenario, peers, recorder, checked());
  EXPECT_EQ(result.end_reason, EndReason::kTripped);
  ASSERT_TRUE(result.controller_trip);
  const controller_status_t& status = result.controller_trip->status;
  EXPECT_EQ(status.overload_error, controller_status_t::OVERLOAD_TOO_FAST);
  EXPECT_EQ(status.overload_motor, 2);
  EXPECT_EQ(status.overload_tick, result.controller_trip->tick + 1);
  EXPECT_GT(status.overload_value, 60);
  EXPECT_LT(status.overload_value, 77);
  EXPECT_EQ(status.overload_limit, 60);
  ASSERT_EQ(result.controller_trip->history.size(), kHistoryTicks);
  EXPECT_EQ(result.controller_trip->history.back().tick, status.overload_tick);
  EXPECT_FALSE(result.step_timing->violation) << result.step_timing->violation->text();
}

// A monitor that speaks of two ticks ago.
class LateMonitor final : public LapMonitor {
 public:
  void judge(Lap& lap) override { lap.verdict.emplace().tick = lap.tick() - 2; }
  void hear(const Lap&) override {}
};

// The controller refuses to be armed then, and says why; nothing will ever move.
TEST(RunLoop, AFaultBeforeTheStartIsNoRunThatCompletes) {
  const sim::Scenario scenario = load("paper_ball", {"duration=0.1"});
  auto params = std::make_unique<firmware::ControllerParams>();
  ASSERT_FALSE(program::to_controller_params(scenario, *params));
  LocalPeers late(std::make_unique<LateMonitor>(),
                  std::make_unique<HostFirmware>(*params, scenario.run.control_period_s), nullptr);
  Recorder recorder("/dev/null");
  const RunResult result = run(scenario, late, recorder, {});
  EXPECT_EQ(result.status, hal::Status::kOk) << result.trouble;
  EXPECT_EQ(result.end_reason, EndReason::kTripped);
  ASSERT_TRUE(result.controller_trip);
  EXPECT_EQ(result.controller_trip->tick, -2);
  EXPECT_EQ(result.controller_trip->faults, static_cast<std::int32_t>(firmware::Fault::kMonitorStale));
}

// A robot set down outside its envelope trips at once and never starts.
TEST(RunLoop, ABallSetDownOutsideItsEnvelopeTripsAtTheStart) {
  const RunResult slips = run_scenario(load("paper_ball", {"surface.static_friction=0.1", "run.actuation=prescribed"}));
  EXPECT_EQ(slips.end_reason, EndReason::kSlipped);
  EXPECT_EQ(slips.final_sample.time_s, 0);
  EXPECT_EQ(slips.trip.tripped, 1);
  const RunResult low = run_scenario(load("paper_ball", {"envelope.min_normal_force=100"}));
  EXPECT_EQ(low.end_reason, EndReason::kTripped);
  EXPECT_EQ(low.trip.cause, trip_t::CAUSE_NORMAL_FORCE);
  EXPECT_EQ(low.motors[0].steps, 0);
}

// A controller that a fault keeps from arming, for its first ticks or for ever; its masses stand.
class NeverArms final : public Peer {
 public:
  NeverArms(Peer& peers, std::int64_t faulty_until) : peers_(peers), faulty_until_(faulty_until) {}
  hal::Status connect() override { return peers_.connect(); }
  hal::Status send(Lap& lap) override { return peers_.send(lap); }
  hal::Status receive(Lap& lap) override {
    const hal::Status result = peers_.receive(lap);
    auto& [status, steps] = *lap.answer;
    const std::int64_t tick = steps.tick;
    if (!standing_) standing_ = steps;  // of the first tick of the countdown: none is made
    steps = *standing_;
    steps.tick = tick;
    status.mode = controller_status_t::MODE_DISARMED;
    status.faults = status.tick <= faulty_until_ ? static_cast<int>(firmware::Fault::kSensorStale) : 0;
    status.at_rest = 1;
    return result;
  }
  [[nodiscard]] std::string trouble() const override { return peers_.trouble(); }

 private:
  Peer& peers_;
  std::int64_t faulty_until_;
  std::optional<step_command_t> standing_;
};

// No monitor trips: the ball lies still. All the same this is not the run that was asked for.
TEST(StepperRun, AControllerThatNeverArmsHasNotCompleted) {
  const sim::Scenario scenario = load("paper_ball", {"duration=0.3"});
  auto params = std::make_unique<firmware::ControllerParams>();
  ASSERT_FALSE(program::to_controller_params(scenario, *params));
  for (const std::int64_t faulty_until : {-2, -1, 100, 1000}) {
    SCOPED_TRACE(faulty_until);
    InProcessPeers inner(params.get(), program::to_monitor_limits(scenario), scenario.run.control_period_s);
    NeverArms peers(inner, faulty_until);
    Recorder recorder("/dev/null");
    const RunResult result = run(scenario, peers, recorder, {});
    EXPECT_EQ(result.status, hal::Status::kOk) << result.trouble;
    EXPECT_EQ(result.end_reason, EndReason::kTripped);
    EXPECT_EQ(exit_status(result), 3);
    ASSERT_TRUE(result.controller_trip);
    EXPECT_EQ(result.controller_trip->faults, static_cast<int>(firmware::Fault::kSensorStale));
    EXPECT_EQ(result.controller_trip->tick, -2);
    EXPECT_EQ(result.last_tick, 0);
  }
}

// Sensors that err change what the controller gets and nothing of the truth, as long as nothing trips.
TEST(StepperRun, RealSensorsLeaveTheTruthAlone) {
  const auto laps_of = [](const std::vector<std::string>& overrides) {
    std::vector<std::string> all{"duration=0.5"};
    all.insert(all.end(), overrides.begin(), overrides.end());
    const sim::Scenario scenario = load("desk_ball", all);
    Rolled rolled = roll(scenario);
    EXPECT_EQ(rolled.result.end_reason, EndReason::kCompleted);
    return std::move(rolled.laps);
  };
  const std::vector<std::string> real{"sensors.attitude=sensed", "sensors.preset=bmi088", "sensors.rate=500",
                                      "sensors.encoder.resolution=0.01", "sensors.position_fix.rate=100"};
  const std::vector<Lap> ideal = laps_of({}), first = laps_of(real), again = laps_of(real);
  ASSERT_EQ(ideal.size(), first.size());
  ASSERT_EQ(ideal.size(), again.size());
  int others = 0;
  for (std::size_t k = 0; k < ideal.size(); ++k) {
    const plant_state_t &a = ideal[k].plant.state, &b = first[k].plant.state;
    EXPECT_TRUE(std::ranges::equal(a.orientation, b.orientation));
    EXPECT_TRUE(std::ranges::equal(a.mass_position, b.mass_position));
    const sensors_t &x = first[k].plant.sensors, &y = again[k].plant.sensors, &z = ideal[k].plant.sensors;
    EXPECT_TRUE(std::ranges::equal(x.gyro_B_radps, y.gyro_B_radps)) << "the same seed";
    EXPECT_TRUE(std::ranges::equal(x.fix_W_m, y.fix_W_m));
    EXPECT_TRUE(std::ranges::equal(x.orientation, z.orientation)) << "the attitude is sensed";
    others += std::ranges::equal(x.gyro_B_radps, z.gyro_B_radps) ? 0 : 1;
    EXPECT_EQ(z.imu_tick, z.tick);
    EXPECT_EQ(x.imu_tick, x.tick - (x.tick % 2 != 0 ? 1 : 0));
    EXPECT_EQ(x.has_encoders, 1);
    EXPECT_EQ(z.has_encoders, 0);
    EXPECT_LE(std::abs(x.encoder[0] - b.mass_position[0]), 0.005 * (1 + 1e-12));
  }
  EXPECT_EQ(others, static_cast<int>(ideal.size()));
}

}  // namespace
}  // namespace ballast::sil
