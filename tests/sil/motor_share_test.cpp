// The motors' share in the messages and the summary.
#include "tools/sil/motor_share.h"

#include <gtest/gtest.h>

#include <cmath>
#include <lcm/lcm-cpp.hpp>
#include <limits>
#include <map>
#include <memory>

#include "sim/masses/motion.h"
#include "tools/program/params.h"
#include "tools/recording/recorder.h"
#include "tools/sil/local_peers.h"
#include "tools/sil/run.h"

namespace ballast::sil {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Recorded {
  sim::Scenario scenario;
  RunResult result;
  std::map<std::int64_t, contact_t> contact;
  std::map<std::int64_t, controller_status_t> status;
};

Recorded record(const std::string& name, const std::vector<std::string>& overrides, const RunOptions& options = {}) {
  const auto read = sim::read_scenario(std::string(BALLAST_SCENARIO_DIR) + "/" + name + ".toml", overrides);
  for (const auto& error : read.errors) ADD_FAILURE() << to_string(error);
  Recorded r{read.scenario, {}, {}, {}};
  auto params = std::make_unique<firmware::ControllerParams>();
  const bool stepper = r.scenario.run.actuation == sim::Actuation::kStepper;
  if (stepper) {
    EXPECT_FALSE(program::to_controller_params(r.scenario, *params));
  }
  InProcessPeers peers(stepper ? params.get() : nullptr, program::to_monitor_limits(r.scenario),
                       r.scenario.run.control_period_s);
  const std::string path =
      testing::TempDir() + "motor_share_" + testing::UnitTest::GetInstance()->current_test_info()->name() + ".lcmlog";
  Recorder recorder(path);
  r.result = run(r.scenario, peers, recorder, options);
  EXPECT_EQ(r.result.status, hal::Status::kOk) << r.result.trouble;
  EXPECT_TRUE(recorder.close());
  lcm::LogFile log(path, "r");
  while (const auto* event = log.readNextEvent()) {
    contact_t contact;
    controller_status_t status;
    const auto size = static_cast<std::size_t>(event->datalen);
    if (hal::decode(event->data, size, contact)) r.contact[contact.tick] = contact;
    if (hal::decode(event->data, size, status)) r.status[status.tick] = status;
  }
  return r;
}

// The plant's Newton and Euler beside the firmware's closed forms: two derivations in separate code, from the same
// commanded masses, attitude and rate. Returns the ticks compared.
int expect_the_firmwares_numbers(const Recorded& r) {
  int compared = 0;
  for (const auto& [tick, contact] : r.contact) {
    if (tick < 0 || std::isnan(contact.commanded_normal_force_n)) continue;
    const controller_status_t& status = r.status.at(tick);
    // Rounding of some hundred operations on forces of a few N; the firmware's 1e-12 of tests/physics.
    EXPECT_NEAR(contact.commanded_normal_force_n, status.normal_force_n, 1e-12) << "tick " << tick;
    EXPECT_NEAR(contact.commanded_static_friction_n, status.static_friction_n, 1e-12) << "tick " << tick;
    EXPECT_NEAR(contact.commanded_mu_required, status.mu_required, 1e-12) << "tick " << tick;
    ++compared;
  }
  return compared;
}

TEST(MotorShare, CommandedForcesAreTheFirmwaresClosedForms) {
  const Recorded r = record("paper_ball", {"duration=1.2"});
  EXPECT_EQ(expect_the_firmwares_numbers(r), 1201);
  EXPECT_TRUE(std::isnan(r.contact.at(-2).commanded_normal_force_n)) << "the countdown";
  EXPECT_TRUE(std::isnan(r.contact.at(-1).commanded_mu_required)) << "the countdown";
}

// The command for the next tick is the scenario's motion there, the later piece's acceleration where two meet.
TEST(MotorShare, WhatIsCommandedNextIsTheScenariosMotion) {
  const Recorded r = record("paper_ball", {"duration=0.5"});
  for (std::size_t i = 0; i < r.scenario.masses.size(); ++i) {
    const sim::PrescribedMotion motion(r.scenario.masses[i]);
    for (const auto& [tick, status] : r.status) {
      if (tick < -1) continue;
      const double time_s = static_cast<double>(tick + 1) * r.scenario.run.control_period_s;
      std::size_t piece = 0;
      while (motion.end_s(piece) <= time_s) ++piece;
      const auto point = motion.at(piece, time_s);
      // Numbers below 1, summed over two pieces.
      ASSERT_NEAR(status.next_position[i], point.position, 1e-14) << tick;
      ASSERT_NEAR(status.next_velocity[i], point.velocity, 1e-14) << tick;
      ASSERT_NEAR(status.next_acceleration[i], point.acceleration, 1e-11) << tick;  // / duration 0.1, in 1e-16 of time
    }
  }
}

// In a stop the commanded motion is the stop, in a move the move; the scenario's motion is not.
TEST(MotorShare, FollowsStopsAndMoves) {
  const Recorded tripped = record("paper_ball", {"envelope.friction_use=0.5"});
  ASSERT_EQ(tripped.result.end_reason, EndReason::kTripped);
  const auto ticks = static_cast<int>(tripped.contact.rbegin()->first) + 1;
  EXPECT_EQ(expect_the_firmwares_numbers(tripped), ticks);
  // At rest the masses are commanded to stand.
  EXPECT_EQ(tripped.status.rbegin()->second.next_velocity[0], 0);

  RunOptions options;
  options.move = firmware::MoveRequest{.masses = 2, .target_position = {0, 0.1}, .speed_fraction = 0.5};
  const Recorded moved = record("paper_ball", {"duration=60"}, options);
  EXPECT_GT(expect_the_firmwares_numbers(moved), 100);
  EXPECT_NEAR(moved.status.rbegin()->second.next_position[1], 0.1, 1e-15);
  EXPECT_EQ(moved.status.rbegin()->second.next_position[0], 0);
}

// The controller knows no drag and no force table; what is commanded is then computed without both. They are no share
// of the motors.
TEST(MotorShare, DragAndForceTablesAreInNeitherOfTheForcesThatAreCompared) {
  const std::vector<std::string> world = {"duration=0.6", "drag.coefficient=0.05", "drag.wind=[2, 0, 0]"};
  const Recorded r = record("paper_ball", world);
  EXPECT_EQ(expect_the_firmwares_numbers(r), 601);
  const Recorded still = record("paper_ball", {"duration=0.6"});
  const double wind_n = 0.05 * 4;
  EXPECT_GT(std::abs(r.contact.at(1).static_friction_n - r.contact.at(1).commanded_static_friction_n), 0.1 * wind_n);
  EXPECT_LT(std::abs(r.result.motor_share.static_friction_n.difference()),
            std::abs(still.result.motor_share.static_friction_n.difference()) + 0.1 * wind_n);

  const Recorded tabled = record(
      "paper_ball", {"duration=0.6", "external_force={ times = [0, 0.5], forces = [[0, 0, 0], [0.3, 0, -0.2]] }"});
  EXPECT_EQ(expect_the_firmwares_numbers(tabled), 601);
}

// The run slips between two ticks: nothing is known to be commanded at that instant.
TEST(MotorShare, AnEndBetweenTicksHasNoCommand) {
  const Recorded r = record("paper_ball", {"surface.static_friction=0.17"});
  ASSERT_EQ(r.result.end_reason, EndReason::kSlipped);
  EXPECT_TRUE(std::isnan(r.contact.rbegin()->second.commanded_normal_force_n));
  EXPECT_FALSE(std::isnan(std::next(r.contact.rbegin())->second.commanded_normal_force_n));
}

TEST(MotorShare, APrescribedRunHasNone) {
  const Recorded r = record("paper_ball", {"duration=0.1", "run.actuation=prescribed"});
  for (const auto& [tick, contact] : r.contact) EXPECT_TRUE(std::isnan(contact.commanded_static_friction_n)) << tick;
  EXPECT_FALSE(r.result.motor_share.seen());
}

contact_t sample(double time_s, double n, double commanded_n, double fs, double commanded_fs) {
  contact_t c{};
  c.time_s = time_s;
  c.normal_force_n = n;
  c.commanded_normal_force_n = commanded_n;
  c.static_friction_n = fs;
  c.commanded_static_friction_n = commanded_fs;
  c.mu_required = sim::mu_required(n, fs);
  c.commanded_mu_required = sim::mu_required(commanded_n, commanded_fs);
  return c;
}

TEST(MotorShare, KeepsWhereTheyAreFurthestApart) {
  MotorShare share;
  EXPECT_FALSE(share.seen());
  contact_t nothing = sample(0, 4, kNaN, 1, kNaN);
  nothing.commanded_mu_required = kNaN;
  share.observe(nothing);
  EXPECT_FALSE(share.seen());
  share.observe(sample(1, 4, 4, 1, 1));
  ASSERT_TRUE(share.seen());
  EXPECT_EQ(share.normal_force_n.difference(), 0);
  EXPECT_EQ(share.commanded_mu_required_max.value, 0.25);
  share.observe(sample(2, 4, 5, 2, 1));
  share.observe(sample(3, 4, 4.5, 1, 2.5));
  contact_t slides = sample(4, 4, 400, 1, 100);
  slides.regime = contact_t::REGIME_SLIDING;
  share.observe(slides);
  EXPECT_EQ(share.normal_force_n.difference(), -1);
  EXPECT_EQ(share.normal_force_n.time_s, 2);
  EXPECT_EQ(share.static_friction_n.difference(), -1.5);
  EXPECT_EQ(share.static_friction_n.commanded, 2.5);
  EXPECT_EQ(share.static_friction_n.time_s, 3);
  EXPECT_EQ(share.mu_required.difference(), 0.25 - 2.5 / 4.5);
  EXPECT_EQ(share.commanded_mu_required_max.value, 2.5 / 4.5);
  EXPECT_EQ(share.commanded_mu_required_max.time_s, 3);
  // Commanded, the ball would leave the ground: no number says how far apart they are.
  share.observe(sample(5, 4, 0, 1, 1));
  EXPECT_EQ(share.mu_required.difference(), -kInfinity);
  share.observe(sample(6, 0, 0, 1, 1));
  EXPECT_EQ(share.mu_required.time_s, 5);
  EXPECT_EQ(share.commanded_mu_required_max.value, kInfinity);
  EXPECT_EQ(share.commanded_mu_required_max.time_s, 5);
}

}  // namespace
}  // namespace ballast::sil
