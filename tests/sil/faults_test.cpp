// Injected faults: given a fault at t = 2 s on the desk robot in full motion, who detects it, in which tick, and how
// the run ends. sim/README.md describes the same.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <lcm/lcm-cpp.hpp>
#include <set>

#include "hal/lcm/channels.h"
#include "sim/scenario/fault.h"
#include "tests/random_seed.h"
#include "tools/faults/faulty_links.h"
#include "tools/faults/injection.h"
#include "tools/program/params.h"
#include "tools/recording/recorder.h"
#include "tools/recording/replay.h"
#include "tools/sil/run.h"
#include "tools/summary/summary.h"

namespace ballast::sil {
namespace {

constexpr std::int64_t kTick = 2000;  // of t = 2 s; the motors make 2.6 microsteps a tick there

sim::Scenario desk_ball(const std::vector<std::string>& faults, const std::vector<std::string>& overrides = {}) {
  std::vector<std::string> all{"duration=4"};
  all.insert(all.end(), overrides.begin(), overrides.end());
  const auto result = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/desk_ball.toml", all, faults);
  for (const auto& error : result.errors) ADD_FAILURE() << to_string(error);
  return result.scenario;
}

struct Outcome {
  RunResult result;
  PeerFailure failure;
};

Outcome run_desk_ball(const sim::Scenario& scenario, const std::string& log = "/dev/null") {
  auto params = std::make_unique<firmware::ControllerParams>();
  const bool stepper = scenario.run.actuation == sim::Actuation::kStepper;
  if (stepper) {
    EXPECT_FALSE(program::to_controller_params(scenario, *params));
  }
  const auto peers = peers_in_process(scenario, stepper ? params.get() : nullptr, program::to_monitor_limits(scenario));
  Recorder recorder(log);
  Outcome outcome{run_with_faults(scenario, *peers, recorder, {}), PeerFailure::kLost};
  outcome.failure = peers->failure();
  EXPECT_TRUE(recorder.close());
  return outcome;
}

Outcome run_desk_ball(const std::string& fault) { return run_desk_ball(desk_ball({fault})); }

// On a floor that holds whatever comes: motors that stand all at once, in full motion, make the ball slip within ticks.
Outcome run_on_perfect_floor(const std::string& fault) {
  return run_desk_ball(desk_ball({fault}, {"surface.static_friction=inf", "surface.kinetic_friction=inf"}));
}

bool has(const RunResult& result, firmware::Fault fault) {
  return result.controller_trip &&
         (static_cast<std::uint32_t>(result.controller_trip->faults) & static_cast<std::uint32_t>(fault)) != 0;
}

// --- messages ---

struct MonitorCase {
  const char* fault;
  int cause;
  std::int64_t tick;
};

// The monitor trips, and the controller hears it in the same tick and stops.
TEST(MessageFault, TheMonitorMissesWhatDoesNotCome) {
  const MonitorCase cases[] = {
      {"messages_dropped@2", trip_t::CAUSE_MISSING, kTick},
      {"messages_dropped@2:channel=BALLAST_CONTACT,duration=0.001", trip_t::CAUSE_MISSING, kTick},
      {"messages_dropped@2:channel=BALLAST_PLANT_STATE", trip_t::CAUSE_MISSING, kTick},
      // The status of this tick is due in the next.
      {"messages_dropped@2:channel=BALLAST_CONTROLLER_STATUS", trip_t::CAUSE_STALE, kTick + 1},
      {"messages_delayed@2:1,peer=monitor", trip_t::CAUSE_MISSING, kTick},
      {"messages_doubled@2", trip_t::CAUSE_REPEATED, kTick},
      {"messages_doubled@2:channel=BALLAST_CONTACT", trip_t::CAUSE_REPEATED, kTick},
      {"messages_reordered@2:peer=monitor", trip_t::CAUSE_MISSING, kTick},
      {"messages_truncated@2:1", trip_t::CAUSE_MISSING, kTick},
      {"messages_truncated@2:65536,channel=BALLAST_CONTACT", trip_t::CAUSE_MISSING, kTick},
      {"sensor_nan@2", trip_t::CAUSE_NONFINITE, kTick},
      {"sensor_nan@2:sensor=orientation", trip_t::CAUSE_NONFINITE, kTick},
      {"clock_jump@2:100", trip_t::CAUSE_MISSING, kTick},
      {"clock_jump@2:-100", trip_t::CAUSE_MISSING, kTick},
  };
  for (const MonitorCase& c : cases) {
    SCOPED_TRACE(c.fault);
    const Outcome outcome = run_desk_ball(c.fault);
    const RunResult& result = outcome.result;
    ASSERT_EQ(result.status, hal::Status::kOk) << result.trouble;
    EXPECT_EQ(result.end_reason, EndReason::kTripped);
    EXPECT_EQ(result.trip.cause, c.cause);
    EXPECT_EQ(result.trip.trip_tick, c.tick);
    ASSERT_TRUE(result.controller_trip);
    EXPECT_EQ(result.controller_trip->tick, c.tick);
    EXPECT_TRUE(has(result, firmware::Fault::kMonitorTrip));
    EXPECT_EQ(result.latency_ticks, 1);
    EXPECT_EQ(exit_status(result), 3);
    EXPECT_EQ(result.motors[0].undelivered_steps, 0);  // the stop reaches the motors whole
  }
}

// The monitor hears all; the controller trips by itself, once what it has is more than a tick old.
TEST(MessageFault, TheControllerTripsOnWhatIsStale) {
  struct Case {
    const char* fault;
    firmware::Fault bit;
  };
  const Case cases[] = {
      {"messages_dropped@2:peer=controller", firmware::Fault::kSensorStale},
      {"messages_delayed@2:2,peer=controller", firmware::Fault::kSensorStale},
      {"messages_truncated@2:peer=controller", firmware::Fault::kSensorStale},
      {"messages_dropped@2:channel=BALLAST_TRIP", firmware::Fault::kMonitorStale},
      {"messages_delayed@2:2,channel=BALLAST_TRIP", firmware::Fault::kMonitorStale},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.fault);
    const RunResult result = run_desk_ball(c.fault).result;
    ASSERT_EQ(result.status, hal::Status::kOk) << result.trouble;
    EXPECT_EQ(result.end_reason, EndReason::kTripped);
    EXPECT_EQ(result.trip.tripped, 0);
    ASSERT_TRUE(result.controller_trip);
    EXPECT_EQ(result.controller_trip->tick, kTick + 1);
    EXPECT_TRUE(has(result, c.bit));
    EXPECT_EQ(exit_status(result), 3);
  }
}

// One tick late is no fault, and twice is once.
TEST(MessageFault, WhatIsHarmlessChangesNothing) {
  const RunResult healthy = run_desk_ball(desk_ball({})).result;
  for (const char* fault :
       {"messages_delayed@2:1,peer=controller", "messages_delayed@2:1,channel=BALLAST_TRIP",
        "messages_reordered@2:peer=controller", "messages_doubled@2:peer=controller",
        "messages_doubled@2:channel=BALLAST_STEP_COMMAND", "messages_doubled@2:channel=BALLAST_TRIP",
        "peer_restarted@2:peer=monitor", "peer_too_slow@2:1,peer=monitor"}) {
    SCOPED_TRACE(fault);
    const RunResult result = run_desk_ball(fault).result;
    ASSERT_EQ(result.status, hal::Status::kOk) << result.trouble;
    EXPECT_EQ(result.end_reason, EndReason::kCompleted);
    EXPECT_EQ(exit_status(result), 0);
    EXPECT_EQ(result.motors[0].steps, healthy.motors[0].steps);
    EXPECT_EQ(result.final_sample.orientation, healthy.final_sample.orientation);
    EXPECT_EQ(result.missing_commands, 0);
    if (std::string(fault).starts_with("messages_doubled")) {
      EXPECT_GT(result.refused.here.repeated, 0);
    }
  }
}

// Nobody aboard can see that pulses did not come: the controller believes they were made. The next command's count
// tells; if none comes, the second that is missing.
TEST(MessageFault, StepsThatDoNotReachTheMotorsEndTheRun) {
  for (const char* fault :
       {"messages_dropped@2:channel=BALLAST_STEP_COMMAND,duration=0.001",
        "messages_dropped@2:channel=BALLAST_STEP_COMMAND", "messages_delayed@2:1,channel=BALLAST_STEP_COMMAND",
        "messages_reordered@2:channel=BALLAST_STEP_COMMAND,duration=0.001",
        "messages_truncated@2:channel=BALLAST_STEP_COMMAND"}) {
    SCOPED_TRACE(fault);
    const RunResult result = run_desk_ball(fault).result;
    EXPECT_EQ(result.status, hal::Status::kPeerLost);
    EXPECT_EQ(result.last_tick, kTick + 1);
    EXPECT_NE(result.trouble.find("motors"), std::string::npos) << result.trouble;
    EXPECT_GE(result.missing_commands, 1);
  }
}

// The place of the bit decides: some bits leave no message of ours (a 20th of them are the type's hash), some numbers
// in their range. 8 of some 1,300 bits in each of 500 messages: that none of them is refused has a chance of (1 -
// 1/20)^4000.
TEST(MessageFault, CorruptedMessagesAreRefusedOrBelieved) {
  for (const char* fault : {"messages_corrupted@2:8", "messages_corrupted@2:8,channel=BALLAST_TRIP",
                            "messages_corrupted@2:8,channel=BALLAST_STEP_COMMAND",
                            "messages_corrupted@2:8,channel=BALLAST_CONTROLLER_STATUS"}) {
    SCOPED_TRACE(fault);
    const RunResult result = run_desk_ball(fault).result;
    EXPECT_GT(result.refused.here.refused(), 0);
    EXPECT_TRUE(result.status == hal::Status::kPeerLost || result.end_reason == EndReason::kTripped);
  }
}

// --- peers ---

TEST(PeerFault, AKilledControllerIsNoticedAndGivenUp) {
  const RunResult result = run_on_perfect_floor("peer_killed@2").result;
  EXPECT_EQ(result.status, hal::Status::kPeerLost);
  EXPECT_NE(result.trouble.find("controller lost"), std::string::npos) << result.trouble;
  EXPECT_EQ(result.trip.cause, trip_t::CAUSE_STALE);
  EXPECT_EQ(result.trip.trip_tick, kTick + 1);
  EXPECT_EQ(result.last_tick, kTick + kGivenUpTicks - 1);
}

TEST(PeerFault, AKilledMonitorStopsTheRobot) {
  const RunResult result = run_desk_ball("peer_killed@2:peer=monitor").result;
  ASSERT_EQ(result.status, hal::Status::kOk) << result.trouble;
  EXPECT_EQ(result.end_reason, EndReason::kTripped);
  EXPECT_EQ(result.controller_trip->tick, kTick + 1);
  EXPECT_TRUE(has(result, firmware::Fault::kMonitorStale));
}

// It finds the trip among what it has missed; its motors have stood meanwhile.
TEST(PeerFault, AFrozenControllerStopsWhenItWakes) {
  for (const std::int64_t ticks : {1, 50}) {
    SCOPED_TRACE(ticks);
    const RunResult result =
        run_on_perfect_floor("peer_frozen@2:duration=" + std::to_string(0.001 * static_cast<double>(ticks))).result;
    ASSERT_EQ(result.status, hal::Status::kOk) << result.trouble;
    EXPECT_EQ(result.end_reason, EndReason::kTripped);
    EXPECT_EQ(result.trip.cause, trip_t::CAUSE_STALE);
    EXPECT_EQ(result.trip.trip_tick, kTick + 1);
    EXPECT_EQ(result.controller_trip->tick, kTick + std::max<std::int64_t>(ticks, 1));
    EXPECT_EQ(result.missing_commands, ticks);
    EXPECT_GT(result.motors[0].undelivered_steps, 0);
    EXPECT_EQ(exit_status(result), 3);
  }
}

TEST(PeerFault, AFrozenMonitorStopsTheRobot) {
  const RunResult result = run_desk_ball("peer_frozen@2:peer=monitor,duration=0.05").result;
  EXPECT_EQ(result.end_reason, EndReason::kTripped);
  EXPECT_EQ(result.controller_trip->tick, kTick + 1);
  EXPECT_TRUE(has(result, firmware::Fault::kMonitorStale));
}

// Disarmed and at rest it would say that all is well.
TEST(PeerFault, ARestartedControllerDoesNotPassForTheOneBefore) {
  const RunResult result = run_desk_ball("peer_restarted@2").result;
  EXPECT_EQ(result.status, hal::Status::kPeerLost);
  EXPECT_NE(result.trouble.find("started again"), std::string::npos) << result.trouble;
  EXPECT_EQ(result.last_tick, kTick);
}

TEST(PeerFault, AMonitorThatIsRestartedAfterATripTakesItBack) {
  const RunResult result =
      run_desk_ball(desk_ball({"sensor_nan@2:duration=0.001", "peer_restarted@2.002:peer=monitor"})).result;
  EXPECT_EQ(result.status, hal::Status::kPeerLost);
  EXPECT_NE(result.trouble.find("takes back"), std::string::npos) << result.trouble;
  EXPECT_EQ(result.last_tick, kTick + 2);
}

TEST(PeerFault, ASlowControllerIsStale) {
  for (const char* fault : {"peer_too_slow@2:1", "peer_too_slow@2:2"}) {
    SCOPED_TRACE(fault);
    const RunResult result = run_on_perfect_floor(fault).result;
    ASSERT_EQ(result.status, hal::Status::kOk) << result.trouble;
    EXPECT_EQ(result.trip.cause, trip_t::CAUSE_STALE);
    EXPECT_EQ(result.trip.trip_tick, kTick + 1);
    EXPECT_EQ(result.end_reason, EndReason::kTripped);
  }
}

TEST(PeerFault, ASlowMonitorIsStaleFromTwoTicksOn) {
  const RunResult result = run_desk_ball("peer_too_slow@2:2,peer=monitor").result;
  EXPECT_EQ(result.end_reason, EndReason::kTripped);
  EXPECT_EQ(result.controller_trip->tick, kTick + 1);
  EXPECT_TRUE(has(result, firmware::Fault::kMonitorStale));
}

// --- sensors ---

// The controller moves the masses by the clock: what its sensors say wrongly, but finitely, changes its predictions and
// not one step. No trip is to be had from them but the monitor's, where they make the controller's N and f_s so wrong
// that they disagree with the plant's.
TEST(SensorFault, WhatIsWrongButFiniteMovesNothing) {
  const RunResult healthy = run_desk_ball(desk_ball({})).result;
  for (const char* fault :
       {"sensor_bias@2:0.1", "sensor_bias@2:0.1,sensor=orientation,axis=1", "sensor_noise@2:0.1,sensor=accelerometer",
        "sensor_freeze@2", "sensor_freeze@2:sensor=limit_switch", "sensor_spike@2:0.1", "sensor_saturation@2:0.01"}) {
    SCOPED_TRACE(fault);
    const RunResult result = run_desk_ball(fault).result;
    ASSERT_EQ(result.status, hal::Status::kOk) << result.trouble;
    EXPECT_EQ(result.end_reason, EndReason::kCompleted);
    EXPECT_EQ(result.motors[0].steps, healthy.motors[0].steps);
    EXPECT_EQ(result.final_sample.orientation, healthy.final_sample.orientation);
  }
}

TEST(SensorFault, WhatMakesTheControllerDisagreeWithThePlantTrips) {
  const RunResult result = run_desk_ball("sensor_spike@2:5").result;
  ASSERT_EQ(result.status, hal::Status::kOk) << result.trouble;
  EXPECT_EQ(result.end_reason, EndReason::kTripped);
  EXPECT_EQ(result.trip.cause, trip_t::CAUSE_DISAGREEMENT);
  // The controller's estimate is in the status of the tick in which it is told; the monitor has that a tick later.
  EXPECT_EQ(result.trip.trip_tick, 2001);
}

std::vector<sensors_t> sensors_of(const std::string& path) {
  std::vector<sensors_t> all;
  lcm::LogFile log(path, "r");
  sensors_t sensors;
  while (const auto* event = log.readNextEvent()) {
    if (event->channel != hal::kChannelSensors || sensors.decode(event->data, 0, event->datalen) <= 0) continue;
    if (sensors.tick >= 0) all.push_back(sensors);
  }
  return all;
}

TEST(SensorFault, EachDoesWhatItSays) {
  const std::string folder = testing::TempDir();
  run_desk_ball(desk_ball({}), folder + "healthy.lcmlog");
  const auto truth = sensors_of(folder + "healthy.lcmlog");
  const auto said = [&](const std::string& fault) {
    run_desk_ball(desk_ball({fault}), folder + "faulty.lcmlog");
    return sensors_of(folder + "faulty.lcmlog");
  };
  const auto at = [](std::int64_t tick) { return static_cast<std::size_t>(tick); };

  const auto bias = said("sensor_bias@2:0.1,axis=1");
  EXPECT_EQ(bias[at(kTick - 1)].gyro_B_radps[1], truth[at(kTick - 1)].gyro_B_radps[1]);
  EXPECT_EQ(bias[at(kTick)].gyro_B_radps[1], truth[at(kTick)].gyro_B_radps[1] + 0.1);
  EXPECT_EQ(bias[at(kTick)].gyro_B_radps[0], truth[at(kTick)].gyro_B_radps[0]);

  const auto spike = said("sensor_spike@2:5,sensor=accelerometer");
  EXPECT_EQ(spike[at(kTick)].accelerometer_B_mps2[2], truth[at(kTick)].accelerometer_B_mps2[2] + 5);
  EXPECT_EQ(spike[at(kTick + 1)].accelerometer_B_mps2[2], truth[at(kTick + 1)].accelerometer_B_mps2[2]);

  const auto frozen = said("sensor_freeze@2:duration=0.1");
  EXPECT_EQ(frozen[at(kTick + 50)].gyro_B_radps[0], truth[at(kTick - 1)].gyro_B_radps[0]);
  EXPECT_EQ(frozen[at(kTick + 100)].gyro_B_radps[0], truth[at(kTick + 100)].gyro_B_radps[0]);

  const auto saturated = said("sensor_saturation@2:0.01");
  for (std::size_t k = at(kTick); k < saturated.size(); ++k) EXPECT_LE(std::abs(saturated[k].gyro_B_radps[1]), 0.01);

  // n draws: their mean is within 4 sigma / sqrt(n), and their variance within 4 sqrt(2 / n) of it, of what was asked.
  const auto noisy = said("sensor_noise@2:0.2");
  double sum = 0, squares = 0;
  int n = 0;
  for (std::size_t k = at(kTick); k < noisy.size(); ++k) {
    for (int j = 0; j < 3; ++j, ++n) {
      const double error = noisy[k].gyro_B_radps[j] - truth[k].gyro_B_radps[j];
      sum += error;
      squares += error * error;
    }
  }
  EXPECT_NEAR(sum / n, 0, 4 * 0.2 / std::sqrt(n));
  EXPECT_NEAR(squares / n, 0.04, 0.04 * 4 * std::sqrt(2.0 / n));

  // A turn by 0.1 rad about axis 2 stays an attitude, and is one by 0.1 rad.
  const auto turned = said("sensor_bias@2:0.1,sensor=orientation,axis=2");
  const double *q = turned[at(kTick)].orientation, *p = truth[at(kTick)].orientation;
  const double product = q[0] * p[0] + q[1] * p[1] + q[2] * p[2] + q[3] * p[3];
  EXPECT_NEAR(product, std::cos(0.05), 1e-12);
}

// Encoders and the position fix are read by nobody on the way to a step, so each fault is looked for in the messages.
TEST(SensorFault, EncodersAndThePositionFixHaveThemToo) {
  const std::string folder = testing::TempDir();
  const std::vector<std::string> sensors{"sensors.attitude=sensed", "sensors.encoder.resolution=0.0015",
                                         "sensors.position_fix.rate=100", "sensors.position_fix.noise=0.005"};
  const auto said = [&](const std::vector<std::string>& faults) {
    run_desk_ball(desk_ball(faults, sensors), folder + "encoder.lcmlog");
    return sensors_of(folder + "encoder.lcmlog");
  };
  const auto truth = said({});
  const auto before = static_cast<std::size_t>(kTick - 1), at = before + 1, after = at + 100;
  ASSERT_EQ(truth[at].has_encoders, 1);
  ASSERT_GT(truth[at].fix_count, 0);
  ASSERT_NE(truth[at].fix_W_m[0], truth[after].fix_W_m[0]);

  const auto bias = said({"sensor_bias@2:0.1,sensor=encoder,mass=1", "sensor_bias@2:0.5,sensor=position_fix,axis=0"});
  EXPECT_EQ(bias[before].encoder[1], truth[before].encoder[1]);
  EXPECT_EQ(bias[at].encoder[0], truth[at].encoder[0]);
  EXPECT_EQ(bias[at].encoder[1], truth[at].encoder[1] + 0.1);
  EXPECT_EQ(bias[at].fix_W_m[0], truth[at].fix_W_m[0] + 0.5);
  EXPECT_EQ(bias[at].fix_W_m[1], truth[at].fix_W_m[1]);

  const auto spike = said({"sensor_spike@2:0.2,sensor=encoder", "sensor_spike@2:3,sensor=position_fix"});
  for (int i = 0; i < spike[at].mass_count; ++i) EXPECT_EQ(spike[at].encoder[i], truth[at].encoder[i] + 0.2) << i;
  EXPECT_EQ(spike[at].fix_W_m[1], truth[at].fix_W_m[1] + 3);
  EXPECT_EQ(spike[at + 1].encoder[0], truth[at + 1].encoder[0]);
  EXPECT_EQ(spike[at + 1].fix_W_m[1], truth[at + 1].fix_W_m[1]);

  const auto frozen =
      said({"sensor_freeze@2:sensor=encoder,duration=0.1", "sensor_freeze@2:sensor=position_fix,duration=0.1"});
  EXPECT_EQ(frozen[after - 1].encoder[0], truth[before].encoder[0]);
  EXPECT_EQ(frozen[after - 1].fix_W_m[0], truth[before].fix_W_m[0]);
  EXPECT_EQ(frozen[after - 1].fix_count, truth[after - 1].fix_count);  // in fresh messages
  EXPECT_EQ(frozen[after].encoder[0], truth[after].encoder[0]);
  EXPECT_EQ(frozen[after].fix_W_m[0], truth[after].fix_W_m[0]);

  const auto saturated =
      said({"sensor_saturation@2:0.01,sensor=encoder", "sensor_saturation@2:0.02,sensor=position_fix"});
  bool reached = false;
  for (std::size_t k = at; k < saturated.size(); ++k) {
    for (int i = 0; i < saturated[k].mass_count; ++i) EXPECT_LE(std::abs(saturated[k].encoder[i]), 0.01);
    for (const double place : saturated[k].fix_W_m) {
      EXPECT_LE(std::abs(place), 0.02);
      reached = reached || std::abs(place) == 0.02;
    }
  }
  EXPECT_TRUE(reached);

  const auto noisy = said({"sensor_noise@2:0.2,sensor=encoder"});
  double squares = 0;
  int n = 0;
  for (std::size_t k = at; k < noisy.size(); ++k) {
    for (int i = 0; i < noisy[k].mass_count; ++i, ++n) {
      squares += std::pow(noisy[k].encoder[i] - truth[k].encoder[i], 2);
    }
  }
  EXPECT_NEAR(squares / n, 0.04, 0.04 * 4 * std::sqrt(2.0 / n));
}

// NaN of an encoder or of a position fix is a fault to monitor and controller alike, in the same tick.
TEST(SensorFault, AnEncoderOrAFixThatIsNoNumberStops) {
  for (const char* fault : {"sensor_nan@2:sensor=encoder,mass=0", "sensor_nan@2:sensor=position_fix"}) {
    SCOPED_TRACE(fault);
    const RunResult result =
        run_desk_ball(desk_ball({fault}, {"sensors.attitude=sensed", "sensors.encoder.resolution=0.0015",
                                          "sensors.position_fix.rate=100"}))
            .result;
    EXPECT_EQ(result.end_reason, EndReason::kTripped);
    EXPECT_EQ(result.trip.cause, trip_t::CAUSE_NONFINITE);
    EXPECT_EQ(result.trip.trip_tick, kTick);
    ASSERT_TRUE(result.controller_trip);
    EXPECT_EQ(result.controller_trip->tick, kTick);
    EXPECT_TRUE(has(result, firmware::Fault::kSensorNotFinite));
  }
}

// --- motors, floor, ball ---

TEST(MotorFault, StepsAreLostBehindTheControllersBack) {
  const RunResult healthy = run_desk_ball(desk_ball({})).result;
  ASSERT_EQ(healthy.final_sample.lost_steps[0], 0);
  for (const char* fault : {"motor_stall@2", "reversed_wiring@2", "blocked_rail@0", "lost_steps@2:200"}) {
    SCOPED_TRACE(fault);
    // On its own floor a mass that is held makes the ball slip before a step is lost; one that is stopped at full speed
    // throws it off any floor.
    const sim::Scenario scenario = desk_ball({fault}, {"surface.static_friction=inf", "surface.kinetic_friction=inf"});
    const RunResult result = run_desk_ball(scenario).result;
    ASSERT_EQ(result.status, hal::Status::kOk) << result.trouble;
    EXPECT_GT(result.final_sample.lost_steps[0], 0);
    // Less speed would not have helped, and is not advised.
    const std::string text = lost_steps_text(scenario, result);
    EXPECT_NE(text.find("The fault " + to_string(scenario.faults[0]) + " was injected into motor 0"), std::string::npos)
        << text;
    EXPECT_EQ(text.find("max_acceleration"), std::string::npos) << text;
    // A fault of another motor, or one that would have begun later, explains nothing.
    sim::Scenario other = scenario;
    other.faults[0].mass = 1;
    EXPECT_NE(lost_steps_text(other, result).find("The torque did not carry"), std::string::npos);
    other = scenario;
    other.faults[0].time_s = result.final_sample.time_s + 1;
    EXPECT_NE(lost_steps_text(other, result).find("The torque did not carry"), std::string::npos);
    // The controller knows nothing of it: if it stopped at all, the monitor told it to.
    if (result.controller_trip) {
      EXPECT_TRUE(has(result, firmware::Fault::kMonitorTrip));
    }
  }
  const RunResult swallowed = run_desk_ball("lost_steps@2:200").result;
  EXPECT_EQ(swallowed.final_sample.lost_steps[0] % 64, 200 % 64);  // but for whole teeth
}

TEST(WorldFault, ASlipperyFloorIsSeenWhereRollingIsLost) {
  const RunResult result = run_desk_ball("friction_falls@2:0.001").result;
  EXPECT_EQ(result.end_reason, EndReason::kSlipped);
  EXPECT_GE(result.final_sample.time_s, 2);
  EXPECT_LE(result.final_sample.time_s, 2.1);  // it needs more than 0.001 nearly always
  EXPECT_EQ(exit_status(result), 3);
}

TEST(WorldFault, APushIsFelt) {
  const RunResult healthy = run_desk_ball(desk_ball({})).result, pushed = run_desk_ball("push@2:3").result;
  EXPECT_GT((pushed.final_sample.velocity_W_mps - healthy.final_sample.velocity_W_mps).norm(), 0.01);
}

// --- the program's own ---

TEST(ProgramFault, AnOverrunEndsTheRunAsLate) {
  const Outcome outcome = run_desk_ball("controller_overrun@2:3");
  EXPECT_EQ(outcome.result.status, hal::Status::kIo);
  EXPECT_EQ(outcome.failure, PeerFailure::kLate);
  EXPECT_EQ(outcome.result.last_tick, kTick - 1);
  EXPECT_NE(outcome.result.trouble.find("3 overruns"), std::string::npos) << outcome.result.trouble;
}

TEST(ProgramFault, AFullDiskEndsTheRunAndKeepsTheLog) {
  const std::string log = testing::TempDir() + "full.lcmlog";
  const Outcome outcome = run_desk_ball(desk_ball({"disk_full@2"}), log);
  EXPECT_EQ(outcome.result.status, hal::Status::kIo);
  EXPECT_TRUE(outcome.result.sink_failed);
  EXPECT_NE(outcome.result.trouble.find("No space left on device (as asked: disk_full at 2 s)"), std::string::npos)
      << outcome.result.trouble;
  EXPECT_EQ(sensors_of(log).back().tick, kTick - 1);
}

// --- all of them ---

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// A second run gives the same bytes, and the log replays: with the same inputs and faults the firmware answers the
// same.
TEST(EveryFault, IsRepeatedAndReplayed) {
  const std::string folder = testing::TempDir();
  for (const sim::FaultKindInfo& kind : sim::fault_kinds()) {
    SCOPED_TRACE(kind.name);
    // Chances where there are any, so that the draws count.
    const bool chance = std::string(kind.value_means).starts_with("probability");
    const std::string value = chance ? ":0.1" : kind.value_default ? "" : ":0.25";
    const sim::Scenario scenario = desk_ball({std::string(kind.name) + "@0.3" + value}, {"duration=0.6"});
    const Outcome first = run_desk_ball(scenario, folder + "first.lcmlog");
    const Outcome second = run_desk_ball(scenario, folder + "second.lcmlog");
    EXPECT_EQ(first.result.last_tick, second.result.last_tick);
    EXPECT_TRUE(bytes_of(folder + "first.lcmlog") == bytes_of(folder + "second.lcmlog"));

    auto params = std::make_unique<firmware::ControllerParams>();
    ASSERT_FALSE(program::to_controller_params(scenario, *params));
    const ReplayedFirmware firmware = firmware_for_replay(scenario, *params);
    const ReplayResult replayed = replay(scenario, folder + "first.lcmlog", *firmware.peer, folder + "replayed.lcmlog",
                                         {.before_tick = firmware.before_tick});
    EXPECT_EQ(replayed.end, ReplayResult::End::kReplayed) << replayed.trouble;
    EXPECT_EQ(replayed.ticks_that_differ, 0) << "first in tick " << replayed.first_difference.value_or(-9);
    EXPECT_GT(replayed.ticks, 295);
  }
}

// Another seed draws other messages.
TEST(EveryFault, DependsOnTheSeed) {
  const char* fault = "messages_dropped@1:0.02,channel=BALLAST_TRIP";
  std::set<std::int64_t> ticks;
  for (const char* seed : {"seed=1", "seed=2", "seed=3", "seed=4"}) {
    const RunResult result = run_desk_ball(desk_ball({fault}, {seed})).result;
    ticks.insert(result.controller_trip ? result.controller_trip->tick : -1);
  }
  EXPECT_GT(ticks.size(), 1u);
}

// A flipped bit of a tick may name any tick to come. Whatever the bit, the next message that is whole is heard.
TEST(MessageFault, ACorruptedTickMakesNobodyDeaf) {
  sim::Scenario scenario = desk_ball({"messages_corrupted@0.01:1,channel=BALLAST_SENSORS,duration=0.001",
                                      "messages_corrupted@0.01:1,channel=BALLAST_CONTROLLER_STATUS,duration=0.001"});
  const std::uint64_t seed = test::random_seed(10);
  int not_taken = 0;
  for (int n = 0; n < 5000; ++n) {
    scenario.seed = seed + static_cast<std::uint64_t>(n);
    SCOPED_TRACE(scenario.seed);
    ControllerLinks controller(scenario);
    MonitorLinks monitor(scenario);
    sensors_t sensors{};
    sensors.scenario_id = scenario.id;
    controller_status_t status{};
    status.scenario_id = scenario.id;
    for (std::int64_t tick = 9; tick < 12; ++tick) {
      sensors.tick = status.tick = tick;
      const hal::TickMail mail = controller.deliver(sensors, nullptr);
      not_taken += tick == 10 && !mail.sensors;
      if (tick != 10) {
        EXPECT_TRUE(mail.sensors);
      }
      contact_t contact{};
      contact.tick = tick;
      plant_state_t state{};
      state.tick = tick;
      monitor.deliver(contact, state, sensors);
      monitor.send(status, tick);
    }
    contact_t contact{};
    contact.tick = sensors.tick = 12;
    const Heard heard = monitor.deliver(contact, {}, sensors);
    ASSERT_TRUE(heard.status);
    EXPECT_EQ(heard.status->tick, 11);
  }
  EXPECT_GT(not_taken, 50) << "64 of some 2,000 bits are the tick's";
}

// A run without faults does not know that there are any.
TEST(EveryFault, LeavesAHealthyRunAlone) {
  EXPECT_FALSE(has_peer_faults(desk_ball({})));
  EXPECT_FALSE(has_peer_faults(desk_ball({"motor_stall@1", "push@1:1", "sensor_nan@1", "disk_full@1"})));
  EXPECT_TRUE(has_peer_faults(desk_ball({"peer_killed@1"})));
  // And these peers, with a fault that never strikes, are those of a healthy run, byte for byte.
  const std::string folder = testing::TempDir();
  sim::Scenario scenario = desk_ball({"messages_dropped@2:1e-15"});
  run_desk_ball(scenario, folder + "never.lcmlog");
  scenario.faults.clear();  // the same fingerprint
  run_desk_ball(scenario, folder + "none.lcmlog");
  EXPECT_TRUE(bytes_of(folder + "never.lcmlog") == bytes_of(folder + "none.lcmlog"));
}

TEST(EveryFault, SummaryNamesIt) {
  const sim::Scenario scenario = desk_ball({"motor_stall@2:mass=1,duration=0.1"});
  const RunResult result = run_desk_ball(scenario).result;
  EXPECT_NE(summary_text(scenario, result, "x").find("fault       motor_stall at 2 s: mass 1, for 0.1 s"),
            std::string::npos);
  EXPECT_NE(summary_json(scenario, result).find("\"kind\": \"motor_stall\""), std::string::npos);
  EXPECT_EQ(summary_json(desk_ball({}), result).find("\"faults\""), std::string::npos);

  const sim::Scenario slips = desk_ball({"friction_falls@1:0.01", "push@3.5:5"});
  const std::string text = summary_text(slips, run_desk_ball(slips).result, "x");
  EXPECT_NE(text.find("fault       friction_falls at 1 s"), std::string::npos) << text;
  EXPECT_NE(text.find("not reached push at 3.5 s"), std::string::npos) << text;
}

}  // namespace
}  // namespace ballast::sil
