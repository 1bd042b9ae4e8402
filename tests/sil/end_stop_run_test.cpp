// A motor driven into the stop of its rail, in a whole run: what plant, firmware, monitor and summary make of it.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "tests/sil/into_its_stop.h"
#include "tools/program/params.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"
#include "tools/summary/summary.h"

namespace ballast::sil {
namespace {

struct Done {
  sim::Scenario scenario;
  RunResult result;
};

Done run_into_its_stop(const std::vector<std::string>& overrides) {
  const auto read = sim::parse_scenario(test::kIntoItsStop, "into_its_stop.toml", overrides);
  for (const auto& error : read.errors) ADD_FAILURE() << to_string(error);
  auto params = std::make_unique<firmware::ControllerParams>();
  const auto refusal = program::to_controller_params(read.scenario, *params);
  EXPECT_FALSE(refusal) << *refusal;
  InProcessPeers peers(params.get(), program::to_monitor_limits(read.scenario), read.scenario.run.control_period_s);
  NoRecord recorder;
  RunOptions options;
  options.check_steps = true;
  return {read.scenario, run(read.scenario, peers, recorder, options)};
}

TEST(EndStopRun, LostStepsTakeAMassIntoItsStopAndTheControllerTrips) {
  const auto [scenario, result] = run_into_its_stop({});
  ASSERT_EQ(result.status, hal::Status::kOk) << result.trouble;
  EXPECT_EQ(result.end_reason, EndReason::kTripped);
  EXPECT_TRUE(result.masses_rested);
  ASSERT_TRUE(result.controller_trip);
  const ControllerTrip& trip = *result.controller_trip;
  EXPECT_EQ(static_cast<std::uint32_t>(trip.faults), static_cast<std::uint32_t>(firmware::Fault::kEndSwitch));
  EXPECT_EQ(trip.sensors.limit_switch[0], 1);
  EXPECT_LT(trip.status.commanded_velocity[0], 0);
  EXPECT_GT(trip.status.commanded_position[0], 0.05) << "the controller believes it is far from its stop";
  EXPECT_EQ(result.trip.tripped, 0) << "inside the envelope all the time";
  // The tick after the touch sees the switch.
  ASSERT_GE(result.end_stops[0].touches, 1);
  EXPECT_GE(trip.time_s, result.end_stops[0].first_s);
  EXPECT_LE(trip.time_s, result.end_stops[0].first_s + scenario.run.control_period_s);
  // Every step the rotor did not make up to the trip, less what the stop's own way brings the command back, and a tooth
  // of lag: 3200 microsteps to 0.05 m.
  const auto lost = static_cast<double>(result.final_sample.lost_steps[0]);
  ASSERT_TRUE(result.stop);
  const double stop_way_m = std::abs(trip.status.commanded_velocity[0]) * result.stop->predicted.duration_s;
  const double off_m = trip.status.commanded_position[0] - result.final_sample.mass_position[0];
  EXPECT_GE(lost, 3200 / 0.05 * (off_m - stop_way_m) - 2 * 64);
  EXPECT_NEAR(lost, std::abs(result.motors[0].steps_behind), 64);
  // It was held by the stop: not further in than its spring lets the motor and the mass's own energy.
  const double k = scenario.masses[0].end_stops.stiffness_npm;
  const double force_n = scenario.masses[0].motor.holding_torque_nm * scenario.masses[0].motor.shaft_ratio;
  EXPECT_DOUBLE_EQ(k, force_n / (1e-3 * 0.17)) << "the default";
  EXPECT_GT(result.end_stops[0].max_force_n, 0.1 * force_n);

  const auto j = nlohmann::json::parse(summary_json(scenario, result));
  EXPECT_EQ(j["trip"]["cause"], "end_switch");
  EXPECT_EQ(j["trip"]["motor"], 0);
  EXPECT_EQ(j["motors"][0]["end_stop"]["touches"], result.end_stops[0].touches);
  EXPECT_EQ(j["motors"][0]["end_stop"]["first_time"], result.end_stops[0].first_s);
  const std::string text = summary_text(scenario, result, "r");
  EXPECT_NE(text.find("end_switch"), std::string::npos) << text;
  EXPECT_NE(text.find("mass 0 touched it"), std::string::npos) << text;
  // The stop held it: that the torque fell short is not known of the steps lost there.
  const std::string warning = lost_steps_text(scenario, result);
  EXPECT_NE(warning.find("Mass 0 met its end stop"), std::string::npos) << warning;
  EXPECT_EQ(warning.find("The torque did not carry"), std::string::npos) << warning;
  EXPECT_EQ(j["motors"][0]["end_stop"]["outside_ball"], nullptr);
  RunResult gave_way = result;
  gave_way.end_stops[0].outside_ball_m = 0.003;
  gave_way.end_stops[0].outside_ball_s = 0.5;
  EXPECT_NE(summary_text(scenario, gave_way, "r").find("WARNING     mass 0 was outside the ball by up to 0.003 m"),
            std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(summary_json(scenario, gave_way))["motors"][0]["end_stop"]["outside_ball"]["depth"],
            0.003);
  RunResult free = result;
  free.end_stops[0] = {};
  EXPECT_NE(lost_steps_text(scenario, free).find("The torque did not carry"), std::string::npos);
}

// The push of the stop comes through to the floor. What the motor alone does to f_s / N stays below 0.01; the monitor
// told to allow 0.018 sees the stop's, within the tick.
TEST(EndStopRun, TheMonitorSeesThePushOfTheStop) {
  const auto [scenario, result] = run_into_its_stop({"envelope.friction_use=0.03"});
  EXPECT_EQ(result.end_reason, EndReason::kTripped);
  EXPECT_EQ(result.trip.cause, trip_t::CAUSE_FRICTION);
  EXPECT_GE(result.trip.trip_time_s, result.end_stops[0].first_s);
  EXPECT_LE(result.trip.trip_time_s, result.end_stops[0].first_s + scenario.run.control_period_s);
  EXPECT_GT(result.trip.value, 0.018);
  EXPECT_LE(result.trip.value, result.extrema.mu_required_max.value);
}

// A strong motor follows all the way and comes nowhere near.
TEST(EndStopRun, AStrongMotorDoesNotTouchIt) {
  const auto [scenario, result] = run_into_its_stop({"mass.0.motor.holding_torque=0.2"});
  EXPECT_EQ(result.end_reason, EndReason::kCompleted);
  EXPECT_EQ(result.end_stops[0].touches, 0);
  EXPECT_EQ(result.final_sample.lost_steps[0], 0);
  EXPECT_EQ(nlohmann::json::parse(summary_json(scenario, result))["motors"][0]["end_stop"], nullptr);
}

}  // namespace
}  // namespace ballast::sil
