// Ideal masses, which are exactly where the controller commands, and the hold before t = 0.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/sil/kept_laps.h"
#include "tools/summary/summary.h"

namespace ballast::sil {
namespace {

sim::Scenario load(const std::string& name, const std::vector<std::string>& overrides,
                   const std::vector<std::string>& faults = {}) {
  const auto read = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides, faults);
  for (const auto& error : read.errors) ADD_FAILURE() << to_string(error);
  return read.scenario;
}

// The ideal run is the prescribed run, integrated tick by tick. Both follow the same accelerations up to rounding.
// Their integrators are held to 1e-10 and 1e-13 of the state a step; the paper's motion lets errors grow about
// 1e3-fold.
TEST(IdealMasses, RollAsPrescribedOnesDo) {
  const RunResult ideal = roll(load("paper_ball", {"run.actuation=ideal"})).result;
  const RunResult prescribed = roll(load("paper_ball", {"run.actuation=prescribed"})).result;
  ASSERT_EQ(ideal.status, hal::Status::kOk) << ideal.trouble;
  EXPECT_EQ(ideal.end_reason, EndReason::kCompleted);
  EXPECT_NEAR(ideal.extrema.mu_required_max.value, prescribed.extrema.mu_required_max.value, 1e-11);
  EXPECT_NEAR(ideal.extrema.normal_force_min.value, prescribed.extrema.normal_force_min.value, 1e-10);
  EXPECT_NEAR(ideal.extrema.normal_force_max.value, prescribed.extrema.normal_force_max.value, 1e-10);
  EXPECT_LT((ideal.final_sample.position_W_m - prescribed.final_sample.position_W_m).norm(), 1e-10);
  EXPECT_LT((ideal.final_sample.orientation - prescribed.final_sample.orientation).norm(), 1e-10);
  EXPECT_GT(ideal.motors[0].steps, 1000) << "the controller steps all the same";
  EXPECT_EQ(ideal.final_sample.lost_steps[0], 0);
}

// Each tick: the masses are where the last status said, and N and f_s are those of the commanded masses.
TEST(IdealMasses, AreWhereTheControllerCommands) {
  const sim::Scenario scenario = load("desk_ball", {"run.actuation=ideal", "duration=3"});
  const Rolled run = roll(scenario);
  ASSERT_EQ(run.result.end_reason, EndReason::kCompleted);
  double fastest = 0;
  for (std::size_t k = 3; k < run.laps.size(); ++k) {
    const controller_status_t& said = run.laps[k - 1].answer->status;
    const plant_state_t& is = run.laps[k].plant.state;
    for (std::size_t i = 0; i < scenario.masses.size(); ++i) {
      ASSERT_EQ(is.mass_position[i], said.next_position[i]) << k;
      ASSERT_EQ(is.mass_velocity[i], said.next_velocity[i]) << k;
      fastest = std::max(fastest, std::abs(is.mass_velocity[i]));
    }
    const contact_t& contact = run.laps[k].plant.contact;
    ASSERT_NEAR(contact.normal_force_n, contact.commanded_normal_force_n, 1e-12 * contact.normal_force_n) << k;
    ASSERT_NEAR(contact.static_friction_n, contact.commanded_static_friction_n, 1e-12 * contact.normal_force_n) << k;
  }
  EXPECT_GT(fastest, 0.01);
}

// Pieces of 0.1 s end inside ticks of 7 ms, so that an acceleration is off by at most its change in such a tick, for
// one tick. That is the jerk, at most 10 per second here, times 7 ms; f_s/N changes by as much in units of the weight.
TEST(IdealMasses, FollowMotionsWhosePiecesEndInsideATick) {
  const std::vector<std::string> coarse{"duration=4.2", "run.control_period=0.007"};
  std::vector<std::string> ideal = coarse, prescribed = coarse;
  ideal.emplace_back("run.actuation=ideal");
  prescribed.emplace_back("run.actuation=prescribed");
  const RunResult a = roll(load("paper_ball", ideal)).result, b = roll(load("paper_ball", prescribed)).result;
  ASSERT_EQ(a.end_reason, EndReason::kCompleted) << a.trouble;
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(a.final_sample.mass_position[i], b.final_sample.mass_position[i], 1e-13);
    EXPECT_NEAR(a.final_sample.mass_velocity[i], b.final_sample.mass_velocity[i], 1e-13);
  }
  EXPECT_NEAR(a.extrema.mu_required_max.value, b.extrema.mu_required_max.value, 0.07);
  EXPECT_LT((a.final_sample.position_W_m - b.final_sample.position_W_m).norm(), 1e-5);
  EXPECT_GT((a.final_sample.position_W_m - b.final_sample.position_W_m).norm(), 1e-14) << "no piece ended in a tick";
}

TEST(IdealMasses, FollowTheStopAfterATrip) {
  const Rolled run =
      roll(load("paper_ball", {"run.actuation=ideal", "surface.static_friction=0.17", "run.on_violation=continue"}));
  EXPECT_EQ(run.result.end_reason, EndReason::kTripped);
  EXPECT_TRUE(run.result.masses_rested);
  ASSERT_TRUE(run.result.stop);
  // The start of a tick comes up to one tick after the crossing.
  EXPECT_NEAR(run.result.stop->start_s, run.result.trip.trip_time_s + 0.001, 0.001);
  const plant_state_t& last = run.laps.back().plant.state;
  for (int i = 0; i < 3; ++i) EXPECT_EQ(last.mass_velocity[i], 0) << i;
}

TEST(IdealMasses, WithoutACommandEndTheRun) {
  for (const char* fault : {"messages_dropped@0.2:channel=BALLAST_STEP_COMMAND", "peer_killed@0.2"}) {
    const RunResult result = roll(load("paper_ball", {"run.actuation=ideal", "duration=1"}, {fault})).result;
    EXPECT_NE(result.status, hal::Status::kOk) << fault;
    EXPECT_NE(result.trouble.find("no good command for tick 20"), std::string::npos) << result.trouble;
    EXPECT_NEAR(result.final_sample.time_s, 0.2, 0.002) << fault;
  }
}

TEST(IdealMasses, HaveNoMotorsToBreak) {
  const auto read = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/paper_ball.toml", {"run.actuation=ideal"},
                                       {"motor_stall@1:mass=0"});
  ASSERT_EQ(read.errors.size(), 1u);
  EXPECT_NE(to_string(read.errors[0]).find("a run with ideal masses has none"), std::string::npos)
      << to_string(read.errors[0]);
}

// Held still, whatever its velocity at t = 0 is.
TEST(Hold, SensorsRunWhileTheBallStands) {
  for (const char* actuation : {"stepper", "ideal", "prescribed"}) {
    SCOPED_TRACE(actuation);
    const std::vector<std::string> common{"duration=0.1", "initial.angular_velocity=[0.1,0.2,0.3]",
                                          std::string("run.actuation=") + actuation};
    std::vector<std::string> held = common;
    held.emplace_back("run.hold=0.05");
    const Rolled run = roll(load("paper_ball", held)), without = roll(load("paper_ball", common));
    ASSERT_EQ(run.result.status, hal::Status::kOk) << run.result.trouble;
    ASSERT_EQ(run.laps.front().tick(), -50);
    ASSERT_EQ(run.laps.size(), 50u + 101u);
    const double g = 1;
    for (std::size_t k = 0; k < 50; ++k) {
      const sensors_t& sensors = run.laps[k].plant.sensors;
      EXPECT_EQ(sensors.tick, static_cast<std::int64_t>(k) - 50);
      EXPECT_EQ(sensors.imu_count, static_cast<std::int64_t>(k) + 1);
      EXPECT_EQ(sensors.utime, (static_cast<std::int64_t>(k) - 50) * 1000);
      for (const double rate : sensors.gyro_B_radps) EXPECT_EQ(rate, 0);
      const double* f = sensors.accelerometer_B_mps2;
      EXPECT_NEAR(std::sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]), g, 1e-14);
      EXPECT_EQ(run.laps[k].plant.contact.time_s, 0);
      for (const double rate : run.laps[k].plant.state.angular_velocity_B_radps) EXPECT_EQ(rate, 0);
      if (run.laps[k].verdict) {
        EXPECT_EQ(run.laps[k].verdict->tripped, 0);
      }
    }
    // From t = 0 on it is the run without a hold.
    EXPECT_EQ(run.laps[50].plant.sensors.gyro_B_radps[2], 0.3);
    const std::size_t shift = run.laps.size() - without.laps.size();
    for (std::size_t k = 50; k < run.laps.size(); ++k) {
      const plant_state_t &a = run.laps[k].plant.state, &b = without.laps[k - shift].plant.state;
      ASSERT_EQ(a.tick, b.tick);
      EXPECT_TRUE(std::ranges::equal(a.orientation, b.orientation));
      EXPECT_TRUE(std::ranges::equal(a.mass_position, b.mass_position));
    }
  }
}

// The two ticks of countdown are part of the hold.
TEST(Hold, OfOneTickIsTheCountdown) {
  const Rolled run = roll(load("paper_ball", {"duration=0.01", "run.hold=0.001"}));
  ASSERT_EQ(run.result.status, hal::Status::kOk) << run.result.trouble;
  EXPECT_EQ(run.laps.front().tick(), -2);
}

}  // namespace
}  // namespace ballast::sil
