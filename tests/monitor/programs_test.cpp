// ballast-monitor and ballast-controller as people run them, and what they make of a scenario.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "hal/lcm/bus.h"
#include "hal/lcm/channels.h"
#include "tests/conformance/test_bus.h"
#include "tools/program/params.h"

namespace ballast::program {
namespace {

constexpr char kScenario[] = R"(
name = "two-masses"
duration = 1.0
gravity = 9.81
external_force = [0.1, 0.2, 0.3]
[ball]
radius = 0.5
mass = 2.0
inertia = [0.09, 0.10, 0.11]
center_of_mass = [0.0, 0.01, -0.02]
[surface]
static_friction = 0.4
[envelope]
min_normal_force = 1.5
friction_use = 0.8
[[mass]]
mass = 0.3
rail = { shape = "circle", radius = 0.3, center = [0, 0, 0], axes = [[1,0,0],[0,0,1]] }
initial_position = 0.25
motion = [ { duration = 0.1, acceleration = [0.5, -0.5] } ]
[mass.motor]
steps_per_revolution = 400
microsteps = 8
gear_ratio = 3.0
[[mass]]
mass = 0.4
rail = { shape = "line", origin = [0,0,-0.2], direction = [1,0,0] }
[mass.motor]
steps_per_revolution = 200
microsteps = 16
travel_per_revolution = 0.04
)";

sim::Scenario scenario(const std::vector<std::string>& overrides = {}) {
  const sim::ScenarioResult result = sim::parse_scenario(kScenario, "test", overrides);
  for (const sim::ScenarioError& error : result.errors) ADD_FAILURE() << sim::to_string(error);
  return result.scenario;
}

TEST(Params, ControllerGetsTheScenario) {
  const sim::Scenario s = scenario();
  const auto params = std::make_unique<firmware::ControllerParams>();
  ASSERT_EQ(to_controller_params(s, *params), std::nullopt);
  EXPECT_EQ(params->scenario_id, s.id);
  EXPECT_NE(params->scenario_id, 0);
  EXPECT_EQ(params->control_period_s, 0.001);
  EXPECT_EQ(params->static_friction, 0.4);
  EXPECT_EQ(params->sensor_stale_ticks, 1);
  EXPECT_EQ(params->monitor_stale_ticks, 1);
  EXPECT_EQ(params->ball.radius_m, 0.5);
  EXPECT_EQ(params->ball.gravity_mps2, 9.81);
  EXPECT_EQ(params->ball.shell_mass_kg, 2.0);
  EXPECT_EQ(params->ball.inertia_kgm2, firmware::Vector3(0.09, 0.10, 0.11));
  EXPECT_EQ(params->ball.center_of_mass_B_m, firmware::Vector3(0, 0.01, -0.02));
  EXPECT_EQ(params->ball.external_force_W_n, firmware::Vector3(0.1, 0.2, 0.3));
  ASSERT_EQ(params->ball.mass_count, 2);
  EXPECT_EQ(params->ball.mass_kg[0], 0.3);
  EXPECT_EQ(params->ball.mass_kg[1], 0.4);
  EXPECT_EQ(params->ball.rail[0].shape, firmware::RailShape::kCircle);
  EXPECT_EQ(params->ball.rail[1].shape, firmware::RailShape::kLine);
  EXPECT_EQ(params->motion[0].at(0).position, 0.25);
  EXPECT_EQ(params->motion[0].at(0).acceleration, 0.5);
  EXPECT_EQ(params->motion[0].end_s(), 0.1);
}

TEST(Params, StepsPerUnit) {
  const auto params = std::make_unique<firmware::ControllerParams>();
  ASSERT_EQ(to_controller_params(scenario(), *params), std::nullopt);
  // Four roundings in each expression, 2^-53 each.
  // One turn of the circle is 3 motor turns of 400 * 8 microsteps.
  EXPECT_NEAR(params->motor[0].steps_per_unit * 2 * std::numbers::pi, 3 * 400 * 8, 9600 * 1e-15);
  // One motor turn of 200 * 16 microsteps is 0.04 m.
  EXPECT_NEAR(params->motor[1].steps_per_unit * 0.04, 200 * 16, 3200 * 1e-15);
}

TEST(Params, RefusalSaysFieldValueAndRangeAndChangesNothing) {
  sim::Scenario s = scenario();
  s.masses[1].motor.max_acceleration = -2;
  const auto params = std::make_unique<firmware::ControllerParams>();
  params->scenario_id = 7;
  const std::optional<std::string> refusal = to_controller_params(s, *params);
  ASSERT_TRUE(refusal.has_value());
  EXPECT_NE(refusal->find("mass.1."), std::string::npos) << *refusal;
  EXPECT_NE(refusal->find("max_acceleration"), std::string::npos) << *refusal;
  EXPECT_NE(refusal->find("-2"), std::string::npos) << *refusal;
  EXPECT_EQ(params->scenario_id, 7);
  EXPECT_EQ(params->ball.mass_count, 0);
}

TEST(Params, TooManyPiecesAreRefused) {
  sim::Scenario s = scenario();
  const auto params = std::make_unique<firmware::ControllerParams>();
  s.masses[0].motion.assign(firmware::kMaxPieces, {.duration_s = 0.01});
  EXPECT_EQ(to_controller_params(s, *params), std::nullopt);
  s.masses[0].motion.push_back({.duration_s = 0.01});
  EXPECT_EQ(to_controller_params(s, *params), "mass.0.motion: 129 pieces: the controller allows at most 128");
}

TEST(Params, ATrajectoryIsRefused) {
  sim::Scenario s = scenario();
  s.masses[1].trajectory = {.times_s = {0, 1}, .points_B_m = {{0, 0, 0}, {0.1, 0, 0}}};
  const auto params = std::make_unique<firmware::ControllerParams>();
  EXPECT_EQ(to_controller_params(s, *params), "mass.1.trajectory: the controller moves masses along rails only");
}

TEST(Params, MonitorGetsTheLimits) {
  const sim::Scenario s = scenario();
  const monitor::MonitorLimits limits = to_monitor_limits(s);
  EXPECT_EQ(limits.min_normal_force_n, 1.5);
  EXPECT_EQ(limits.friction_use, 0.8);
  EXPECT_EQ(limits.static_friction, 0.4);
  EXPECT_TRUE(limits.controller_expected);
  EXPECT_EQ(limits.scenario_id, s.id);
  // 5 % of the weight; four roundings.
  EXPECT_NEAR(limits.disagreement_n, 0.05 * (2.0 + 0.3 + 0.4) * 9.81, 1e-15);
  // Where nothing weighs, of what presses the ball down instead.
  sim::Scenario pressed = s;
  pressed.gravity_mps2 = 0;
  pressed.external_force_W_n = {0, 0, -20};
  EXPECT_EQ(to_monitor_limits(pressed).disagreement_n, 0.05 * 20);
  pressed.external_force_W_n.setZero();
  EXPECT_EQ(to_monitor_limits(pressed).disagreement_n, std::numeric_limits<double>::infinity());
  // Drag and force tables are in neither of the two forces that are compared.
  EXPECT_EQ(to_monitor_limits(scenario({"drag.coefficient=0.1"})).disagreement_n, limits.disagreement_n);
  EXPECT_FALSE(to_monitor_limits(scenario({"run.actuation=prescribed"})).controller_expected);
}

// A program started with both outputs in one pipe.
class Program {
 public:
  explicit Program(std::vector<std::string> arguments) {
    int ends[2];
    if (pipe(ends) != 0) ADD_FAILURE() << "pipe";
    pid_ = fork();
    if (pid_ == 0) {
      dup2(ends[1], STDOUT_FILENO);
      dup2(ends[1], STDERR_FILENO);
      close(ends[0]);
      close(ends[1]);
      ::signal(SIGHUP, SIG_DFL);  // the tests themselves may be run under nohup
      std::vector<char*> argv;
      for (std::string& argument : arguments) argv.push_back(argument.data());
      argv.push_back(nullptr);
      execv(argv[0], argv.data());
      _exit(126);
    }
    close(ends[1]);
    output_fd_ = ends[0];
  }
  [[nodiscard]] pid_t pid() const { return pid_; }
  // Exit status; -1: it did not end by itself.
  int wait() {
    char buffer[512];
    for (ssize_t n; (n = read(output_fd_, buffer, sizeof buffer)) > 0;)
      output_.append(buffer, static_cast<std::size_t>(n));
    close(output_fd_);
    int status = 0;
    waitpid(pid_, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  const std::string& output() const { return output_; }

 private:
  pid_t pid_ = -1;
  int output_fd_ = -1;
  std::string output_;
};

class Programs : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    file_ = ::testing::TempDir() + "ballast-programs-" + std::to_string(getpid()) + ".toml";
    std::ofstream(file_) << kScenario;
  }
  void TearDown() override { std::remove(file_.c_str()); }

  std::string file_;
};

TEST_P(Programs, BadUsageAndBadScenariosExitWith1) {
  EXPECT_EQ(Program({GetParam()}).wait(), 1);
  EXPECT_EQ(Program({GetParam(), file_, "--nonsense"}).wait(), 1);
  EXPECT_EQ(Program({GetParam(), file_, "--peer-timeout", "-1"}).wait(), 1);
  EXPECT_EQ(Program({GetParam(), file_, "--actuation", "magic"}).wait(), 1);

  Program missing({GetParam(), "no-such-scenario"});
  EXPECT_EQ(missing.wait(), 1);
  EXPECT_NE(missing.output().find("no-such-scenario"), std::string::npos) << missing.output();

  // Every fault is said, and --set does not swallow the scenario.
  Program bad({GetParam(), "--set", "ball.mass=-1", "--set", "ball.radius=-2", file_});
  EXPECT_EQ(bad.wait(), 1);
  EXPECT_NE(bad.output().find("ball.mass"), std::string::npos) << bad.output();
  EXPECT_NE(bad.output().find("ball.radius"), std::string::npos) << bad.output();
}

TEST_P(Programs, HelpExitsWith0) { EXPECT_EQ(Program({GetParam(), "--help"}).wait(), 0); }

TEST_P(Programs, BusTroubleExitsWith2) {
  Program program({GetParam(), file_, "--lcm", "nonsense://"});
  EXPECT_EQ(program.wait(), 2);
  EXPECT_NE(program.output().find("nonsense://"), std::string::npos) << program.output();
}

TEST_P(Programs, LostPlantExitsWith2AndIsNamed) {
  Program program({GetParam(), file_, "--lcm", hal::test::test_bus_url(), "--start-timeout", "0.2"});
  EXPECT_EQ(program.wait(), 2);
  EXPECT_NE(program.output().find("plant"), std::string::npos) << program.output();
  EXPECT_NE(program.output().find("0.2 s"), std::string::npos) << program.output();
}

// Sent by the test, which has started them, or by a shell, which has not.
TEST_P(Programs, SignalsEndThemWithAMessage) {
  struct Case {
    int number;
    bool by_shell;
    const char* says;
  };
  for (const auto& [number, by_shell, says] : {Case{SIGINT, false, "told to end by the program that started it"},
                                               Case{SIGTERM, true, "interrupted"}, Case{SIGHUP, true, "interrupted"}}) {
    hal::Bus bus(hal::test::test_bus_url());
    bool alive = false;
    bus.subscribe<controller_status_t>(hal::kChannelControllerStatus,
                                       [&](const controller_status_t&) { alive = true; });
    bus.subscribe<trip_t>(hal::kChannelTrip, [&](const trip_t&) { alive = true; });
    Program program({GetParam(), file_, "--lcm", hal::test::test_bus_url()});
    EXPECT_EQ(bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(30)), [&] { return alive; }),
              hal::Status::kOk);
    if (by_shell) {
      EXPECT_EQ(std::system(("kill -" + std::to_string(number) + " " + std::to_string(program.pid())).c_str()), 0);
    } else {
      kill(program.pid(), number);
    }
    EXPECT_EQ(program.wait(), 2);
    EXPECT_NE(program.output().find(says), std::string::npos) << program.output();
  }
}

INSTANTIATE_TEST_SUITE_P(Both, Programs, ::testing::Values(BALLAST_MONITOR_PROGRAM, BALLAST_CONTROLLER_PROGRAM),
                         [](const auto& parameter) { return parameter.index == 0 ? "Monitor" : "Controller"; });

using ControllerProgram = Programs;
TEST_F(ControllerProgram, HasNothingToDoInAPrescribedRun) {
  Program program({BALLAST_CONTROLLER_PROGRAM, file_, "--actuation", "prescribed"});
  EXPECT_EQ(program.wait(), 1);
  EXPECT_NE(program.output().find("no controller in a prescribed run"), std::string::npos) << program.output();
}

// Both programs with a plant played by the test: a whole short run, inside the envelope or not.
class WholeRun : public Programs {
 protected:
  // Exit statuses of monitor and controller after five ticks.
  std::pair<int, int> run(double normal_force_n) {
    const std::string url = hal::test::test_bus_url();
    const std::int64_t id = scenario().id;
    hal::Bus bus(url);
    bus.join(7);
    std::optional<std::int64_t> trip_tick, status_tick, steps_tick;
    bus.subscribe<trip_t>(hal::kChannelTrip, [&](const trip_t& m) { trip_tick = m.tick; });
    bus.subscribe<controller_status_t>(hal::kChannelControllerStatus,
                                       [&](const controller_status_t& m) { status_tick = m.tick; });
    bus.subscribe<step_command_t>(hal::kChannelStepCommand, [&](const step_command_t& m) { steps_tick = m.tick; });
    Program monitor({BALLAST_MONITOR_PROGRAM, file_, "--lcm", url, "--peer-timeout", "30"});
    Program controller({BALLAST_CONTROLLER_PROGRAM, file_, "--lcm", url, "--peer-timeout", "30"});
    const auto wait_for = [&](auto done) {
      EXPECT_EQ(bus.receive_until(hal::after(hal::WallClock::now(), hal::Seconds(30)), done), hal::Status::kOk);
    };
    wait_for([&] { return trip_tick == hal::kWaitingTick && status_tick == hal::kWaitingTick; });
    for (std::int64_t k = -2; k <= 2; ++k) {
      contact_t contact{};
      plant_state_t state{};
      sensors_t sensors{};
      contact.tick = state.tick = sensors.tick = k;
      sensors.scenario_id = id;
      contact.normal_force_n = contact.normal_force_min_n = normal_force_n;
      state.orientation[0] = sensors.orientation[0] = 1;
      sensors.attitude_valid = 1;
      state.mass_count = sensors.mass_count = 2;
      contact.last = state.last = sensors.last = k == 2 ? 1 : 0;
      EXPECT_EQ(bus.publish(hal::kChannelContact, contact), hal::Status::kOk);
      EXPECT_EQ(bus.publish(hal::kChannelPlantState, state), hal::Status::kOk);
      EXPECT_EQ(bus.publish(hal::kChannelSensors, sensors), hal::Status::kOk);
      wait_for([&] { return trip_tick == k && status_tick == k && steps_tick == k + 1; });
    }
    const int monitor_exit = monitor.wait();
    const int controller_exit = controller.wait();
    EXPECT_EQ(monitor.output() + controller.output(), "");
    return {monitor_exit, controller_exit};
  }
};

TEST_F(WholeRun, InsideTheEnvelopeExitsWith0) { EXPECT_EQ(run(9.81), std::pair(0, 0)); }

TEST_F(WholeRun, TripExitsWith3InTheMonitorOnly) { EXPECT_EQ(run(1.5), std::pair(3, 0)); }

}  // namespace
}  // namespace ballast::program
