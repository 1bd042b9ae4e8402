// `ballast run`, `ballast check` and `ballast move` as people run them.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <regex>

#include "sim/scenario/fault.h"
#include "tests/sil/into_its_stop.h"
#include "tests/sil/shell.h"

namespace ballast {
namespace {

using test::Folder;
using test::Outcome;
using test::read_file;

const std::string kBall = R"(
duration = 0.2
gravity = 1.0
[ball]
radius = 1.0
mass = 1.0
inertia = [0.9, 1.0, 1.1]
[surface]
static_friction = 0.5
[[mass]]
mass = 1.0
rail = { shape = "circle", radius = 0.5, direction = { azimuth = 0.0, elevation = 0.0 } }
motion = [ { duration = 0.1, acceleration = [1.0, 0.0] } ]
)";

TEST(Run, LeavesSummaryAndLogAndExitsWith0) {
  const Folder folder;
  const Outcome run = folder.run("ballast run paper_ball --set duration=1");
  EXPECT_EQ(run.exit_status, 0) << run.err;
  EXPECT_EQ(run.err, "");  // no progress bar where there is no terminal
  for (const char* word : {"completed", "least N", "most f_s/N", "rolls on", "steps", "speed", "runs/paper_ball"}) {
    EXPECT_NE(run.out.find(word), std::string::npos) << word;
  }
  const auto s = folder.summary("runs/paper_ball");
  EXPECT_EQ(s["scenario"], "paper_ball");
  EXPECT_EQ(s["actuation"], "stepper");
  EXPECT_EQ(s["end"]["reason"], "completed");
  EXPECT_EQ(s["end"]["time"], 1.0);
  EXPECT_EQ(s["trip"], nullptr);
  EXPECT_EQ(s["motors"].size(), 3u);
  EXPECT_GT(s["motors"][0]["steps"], 50);  // 0.135 rad of the profile in 1 s, of 3200 microsteps a turn: 68
  EXPECT_LT(s["motors"][0]["steps"], 90);
  EXPECT_EQ(s["surfaces"].size(), 8u);
  EXPECT_EQ(s["regimes"][0]["regime"], "rolling");
  EXPECT_TRUE(std::filesystem::exists(folder / "runs/paper_ball/run.lcmlog"));
}

// The wall clock keeps a run back and does not hurry it: how much slower it was depends on the machine.
TEST(Run, SaysHowSlowItWas) {
  const Folder folder;
  const Outcome run = folder.run("ballast run paper_ball --set duration=0.01 --speed 0.02 --out r");
  EXPECT_EQ(run.exit_status, 0) << run.err;
  const std::size_t at = run.out.find("  speed       ");
  ASSERT_NE(at, std::string::npos) << run.out;
  char* rest = nullptr;
  const double speed = std::strtod(run.out.c_str() + at + std::string_view("  speed       ").size(), &rest);
  EXPECT_TRUE(std::string_view(rest).starts_with(" times real time")) << run.out;
  EXPECT_GT(speed, 0);
  EXPECT_LE(speed, 0.02);
}

TEST(Run, SameScenarioSameBytes) {
  const Folder folder;
  ASSERT_EQ(folder.run("ballast run desk_ball --set duration=1 --quiet --out a").exit_status, 0);
  ASSERT_EQ(folder.run("ballast run desk_ball --set duration=1 --quiet --out b").exit_status, 0);
  EXPECT_TRUE(test::read_file(folder / "a/run.lcmlog") == test::read_file(folder / "b/run.lcmlog"));
  EXPECT_GT(std::filesystem::file_size(folder / "a/run.lcmlog"), 100000u);
  auto a = folder.summary("a"), b = folder.summary("b");
  for (auto* s : {&a, &b}) s->erase("wall_time"), s->erase("speed");
  EXPECT_EQ(a, b);
  // Another seed draws other tooth errors.
  ASSERT_EQ(folder.run("ballast run desk_ball --set duration=1 --quiet --seed 1 --out c").exit_status, 0);
  EXPECT_FALSE(test::read_file(folder / "a/run.lcmlog") == test::read_file(folder / "c/run.lcmlog"));
  EXPECT_EQ(folder.summary("c")["seed"], 1);
}

TEST(Run, ChecksEveryStepIfAsked) {
  const Folder folder;
  const Outcome run = folder.run("ballast run paper_ball --set duration=2 --check-steps");
  EXPECT_EQ(run.exit_status, 0) << run.err;
  EXPECT_NE(run.out.find("steps checked"), std::string::npos) << run.out;
  const auto s = folder.summary("runs/paper_ball");
  const auto& timing = s["step_timing"];
  std::int64_t steps = 0;
  for (const auto& motor : s["motors"]) steps += motor["steps"].get<std::int64_t>();
  EXPECT_GT(steps, 400);
  EXPECT_GE(timing["checked_steps"].get<std::int64_t>(), steps) << "and those of the tick after the end";
  EXPECT_LE(timing["max_error_us"].get<double>(), 0.5);
  EXPECT_EQ(timing["violations"].size(), 0u);
  EXPECT_EQ(timing["motion_left_tick"], nullptr);
  std::int64_t in_bins = 0;
  for (const auto& motor : timing["motors"]) {
    for (const auto& bin : motor["histogram"]) in_bins += bin.get<std::int64_t>();
  }
  EXPECT_EQ(in_bins, timing["checked_steps"].get<std::int64_t>());
  // After a trip the pulses are a stop's.
  ASSERT_EQ(folder.run("ballast run paper_ball --check-steps --set envelope.friction_use=0.5").exit_status, 3);
  const auto stop = folder.summary("runs/paper_ball")["step_timing"];
  EXPECT_TRUE(stop["motion_left_tick"].is_number());
  EXPECT_GT(stop["plan_steps"].get<std::int64_t>(), 0);
  EXPECT_EQ(stop["steps_outside_the_motion"], 0);
  EXPECT_EQ(stop["violations"].size(), 0u);
  // Nothing to check.
  EXPECT_EQ(folder.run("ballast run paper_ball --check-steps --actuation prescribed").exit_status, 1);
}

// A motion that no motor could follow may still be prescribed, as the paper does.
TEST(Run, APrescribedRunKnowsNoMotorLimits) {
  const Folder folder;
  for (const std::string limit : {"max_step_rate=10", "max_acceleration=0.5", "max_jerk=1"}) {
    const std::string line = " paper_ball --set duration=0.3 --set mass.1.motor." + limit + " --actuation ";
    for (const std::string command : {"ballast check", "ballast run"}) {
      EXPECT_EQ(folder.run(command + line + "prescribed").exit_status, 0) << limit;
      const Outcome stepper = folder.run(command + line + "stepper");
      EXPECT_EQ(stepper.exit_status, 1) << limit;
      // File, line, piece, value, limit.
      EXPECT_NE(stepper.err.find("paper_ball.toml:4"), std::string::npos) << stepper.err;
      EXPECT_NE(stepper.err.find("mass.1.motion."), std::string::npos) << stepper.err;
      EXPECT_NE(stepper.err.find("(motor." + limit.substr(0, limit.find('=')) + ")"), std::string::npos) << stepper.err;
    }
  }
}

TEST(Run, QuietSaysNothing) {
  const Folder folder;
  const Outcome run = folder.run("ballast run paper_ball --set duration=0.1 --quiet");
  EXPECT_EQ(run.exit_status, 0);
  EXPECT_EQ(run.out + run.err, "");
}

TEST(Run, AnEarlierRunsFilesDoNotStay) {
  const Folder folder;
  ASSERT_EQ(folder.run("ballast run paper_ball --set duration=0.1 --quiet --out r && touch r/path.png r/mine.png")
                .exit_status,
            0);
  ASSERT_EQ(folder.run("ballast run paper_ball --set duration=0.1 --quiet --out r").exit_status, 0);
  EXPECT_FALSE(std::filesystem::exists(folder / "r/path.png"));  // would show another run than the log
  EXPECT_TRUE(std::filesystem::exists(folder / "r/mine.png"));
}

// Trips on friction, exit 3, with time, value and limit.
TEST(Run, GlassTripsOnFriction) {
  const Folder folder;
  for (const std::string actuation : {"stepper", "prescribed"}) {
    const Outcome run =
        folder.run("ballast run paper_ball --set surface.static_friction=0.17 --out r --actuation " + actuation);
    EXPECT_EQ(run.exit_status, 3) << run.err;
    EXPECT_NE(run.out.find("friction at t ="), std::string::npos) << run.out;
    const auto s = folder.summary("r");
    EXPECT_EQ(s["end"]["reason"], "slipped");
    EXPECT_EQ(s["trip"]["cause"], "friction");
    EXPECT_EQ(s["trip"]["limit"], 0.17);
    EXPECT_GE(s["trip"]["value"], 0.17);  // f_s > mu_s N; the quotient may round to mu_s
    EXPECT_NEAR(s["trip"]["value"], 0.17, 1e-9);
    EXPECT_EQ(s["trip"]["time"], s["end"]["time"]);
    EXPECT_LE(s["trip"]["latency_ticks"], 1);
    EXPECT_FALSE(s["surfaces"][6]["holds"]);  // glass
    EXPECT_TRUE(s["surfaces"][1]["holds"]);   // steel
  }
}

// A gyro that begins to lie looks like slip; the stop for it makes the ball slip.
TEST(Run, NamesBothTripsInTheirOrder) {
  const Folder folder;
  const Outcome run = folder.run(
      "ballast run desk_ball --set sensors.preset=bmi088_calibrated --set duration=4 --out r "
      "--fault sensor_bias@3:0.3,sensor=gyro,axis=1");
  EXPECT_EQ(run.exit_status, 3) << run.err;
  const auto trip = folder.summary("r")["trip"];
  EXPECT_EQ(trip["cause"], "slip_measured");
  EXPECT_EQ(trip["latency_ticks"], nullptr);
  EXPECT_EQ(trip["monitor"]["cause"], "friction");
  EXPECT_EQ(trip["monitor"]["limit"], 0.5);
  EXPECT_GT(trip["monitor"]["tick"], trip["tick"]);
  const auto own = run.out.find("by the controller itself at t = 3.0"), later = run.out.find("; then by the monitor, ");
  EXPECT_LT(own, later) << run.out;
  EXPECT_NE(later, std::string::npos) << run.out;
}

// A patch of ice under the start: where it slips, and that the floor is less there than the monitor was told.
TEST(Run, SaysWhatAPatchHolds) {
  const Folder folder;
  const std::string ice =
      " paper_ball --actuation prescribed --set duration=3 --set "
      "'surface.patch=[{circle={center=[0,0],radius=0.5},static_friction=0.001}]'";
  const Outcome needs = folder.run("ballast friction" + ice);
  EXPECT_NE(needs.out.find("with patches, it slips at t = "), std::string::npos) << needs.out << needs.err;
  EXPECT_NE(needs.out.find("mu_s = 0.001\n"), std::string::npos) << needs.out;
  const Outcome run = folder.run("ballast run" + ice + " --set run.on_violation=continue --out r");
  EXPECT_EQ(run.exit_status, 3) << run.err;
  EXPECT_NE(run.out.find("(mu_s = 0.001 where it was)"), std::string::npos) << run.out;
  EXPECT_EQ(run.out.find("  believed "), std::string::npos) << "with prescribed masses nobody acts by a belief";
}

// Half the cone allowed: the monitor trips although nothing slips, and the masses are stopped.
TEST(Run, TripStopsTheMasses) {
  const Folder folder;
  EXPECT_EQ(folder.run("ballast run paper_ball --set envelope.friction_use=0.5 --out r").exit_status, 3);
  const auto s = folder.summary("r");
  EXPECT_EQ(s["end"]["reason"], "tripped");
  EXPECT_EQ(s["trip"]["cause"], "friction");
  EXPECT_EQ(s["trip"]["limit"], 0.175);
  EXPECT_EQ(s["trip"]["latency_ticks"], 1);
  EXPECT_GT(s["end"]["time"], s["trip"]["time"]);
  EXPECT_LT(s["end"]["time"], s["trip"]["time"].get<double>() + 5);
  // At rest: the true masses, within a twentieth of their cruising speed of 0.15 rad/s.
  for (const auto& velocity : s["final"]["mass_velocity"]) EXPECT_LT(std::abs(velocity.get<double>()), 0.0095);
}

// The stop's steps end at 1.226 s, the swing 35 ms later: what a run that ends between them shows is the swing.
TEST(Run, MassesThatAreStoppedAndStillSwingAreSaidTo) {
  const Folder folder;
  const std::string line = "ballast run desk_ball --set envelope.friction_use=0.5 --out r --set duration=";
  const Outcome cut = folder.run(line + "1.24");
  const auto s = folder.summary("r");
  ASSERT_EQ(s["end"]["reason"], "tripped");
  ASSERT_EQ(s["end"]["masses_at_rest"], false);
  EXPECT_GT(1.24, s["stop"]["start"].get<double>() + s["stop"]["duration"].get<double>());
  EXPECT_NE(cut.out.find("stopped; at t = 1.24 s, the run's end, the masses still swung in their motors\n"),
            std::string::npos)
      << cut.out;
  EXPECT_NE(folder.run(line + "2").out.find("tripped; the masses were at rest at t = 1.2"), std::string::npos);
}

// A peak between two ticks is a violation, seen by the monitor in the tick after it: exit 0 means the located maximum
// is inside.
TEST(Run, APeakBetweenTicksTrips) {
  const Folder folder;
  ASSERT_EQ(folder.run("ballast run desk_ball --quiet --out free").exit_status, 0);
  const double peak = folder.summary("free")["mu_required"]["max"];
  const auto run_with = [&](double limit) {
    std::ostringstream use;
    use.precision(17);
    use << limit / 0.5;
    return folder.run("ballast run desk_ball --quiet --out r --set envelope.friction_use=" + use.str()).exit_status;
  };
  EXPECT_EQ(run_with(peak * (1 + 1e-9)), 0);
  EXPECT_EQ(run_with(peak * (1 - 1e-9)), 3);
  EXPECT_EQ(folder.summary("r")["trip"]["cause"], "friction");
}

// Masses whose motion is prescribed cannot be stopped: the run goes on to its end, and still says that it tripped.
TEST(Run, APrescribedRunThatTripsIsCompletedAndExitsWith3) {
  const Folder folder;
  const Outcome run =
      folder.run("ballast run paper_ball --actuation prescribed --set envelope.friction_use=0.5 --out r");
  EXPECT_EQ(run.exit_status, 3) << run.err;
  const auto s = folder.summary("r");
  EXPECT_EQ(s["end"]["reason"], "completed");
  EXPECT_EQ(s["end"]["time"], 20.0);
  EXPECT_EQ(s["trip"]["cause"], "friction");
  EXPECT_EQ(s["trip"]["limit"], 0.175);
  EXPECT_GT(s["trip"]["value"], 0.175);
}

// The push leaves each mass with 0.1 * 1 + 0.1 * 1 / 2 = 0.15 rad/s, faster than anywhere before.
TEST(Run, TheStepRateIsThatOfTheMasses) {
  const Folder folder;
  ASSERT_EQ(folder.run("ballast run paper_ball --set duration=2 --quiet --out r").exit_status, 0);
  const double rate_hz = 0.15 * 3200 / (2 * M_PI);  // 76.4
  // Each of two pulses is within 0.5 us of its place, so an interval of 13.1 ms is within 1 us.
  const double tolerance_hz = rate_hz * rate_hz * 1e-6 * 1.01;
  const auto motors = folder.summary("r")["motors"];
  ASSERT_EQ(motors.size(), 3u);
  for (const auto& motor : motors) EXPECT_NEAR(motor["max_step_rate"].get<double>(), rate_hz, tolerance_hz);
}

// The fields of the contract, in both actuations. tests/summary holds all of them to the schema.
TEST(Run, SummaryHasEveryFieldOfTheContract) {
  const Folder folder;
  for (const std::string actuation : {"stepper", "prescribed"}) {
    ASSERT_EQ(
        folder.run("ballast run paper_ball --set duration=0.5 --quiet --out r --actuation " + actuation).exit_status,
        0);
    const auto s = folder.summary("r");
    for (const char* pointer : {"/scenario",
                                "/actuation",
                                "/seed",
                                "/end/reason",
                                "/end/time",
                                "/mu_required/max",
                                "/mu_required/time",
                                "/normal_force/min",
                                "/normal_force/min_time",
                                "/normal_force/max",
                                "/normal_force/max_time",
                                "/static_friction/max",
                                "/static_friction/time",
                                "/motor_share",
                                "/final/mass_position/2",
                                "/final/mass_velocity/2",
                                "/final/orientation/3",
                                "/final/angular_velocity/2",
                                "/final/position/2",
                                "/regimes/0/regime",
                                "/regimes/0/start",
                                "/regimes/0/end",
                                "/impacts",
                                "/trip",
                                "/surfaces/7/name",
                                "/surfaces/7/mu_s",
                                "/surfaces/7/holds",
                                "/motors/2/steps",
                                "/motors/2/lost_steps",
                                "/motors/2/slips",
                                "/motors/2/steps_behind",
                                "/motors/2/energy",
                                "/motors/2/max_step_rate",
                                "/motors/2/max_torque",
                                "/motors/2/torque_margin",
                                "/motors/2/parameters/shaft_ratio",
                                "/motors/2/parameters/steps_per_revolution",
                                "/motors/2/parameters/holding_torque",
                                "/motors/2/parameters/detent_torque",
                                "/motors/2/parameters/viscous_damping",
                                "/motors/2/parameters/corner_speed",
                                "/wall_time",
                                "/speed"}) {
      EXPECT_TRUE(s.contains(nlohmann::json::json_pointer(pointer))) << pointer;
    }
    EXPECT_EQ(s["motor_share"].is_null(), actuation == "prescribed");
    if (actuation == "prescribed") continue;
    for (const char* pointer :
         {"/normal_force/difference", "/normal_force/time", "/normal_force/real", "/normal_force/commanded",
          "/static_friction/difference", "/mu_required/difference", "/mu_required_max/real",
          "/mu_required_max/real_time", "/mu_required_max/commanded", "/mu_required_max/commanded_time"}) {
      EXPECT_TRUE(s["motor_share"][nlohmann::json::json_pointer(pointer)].is_number()) << pointer;
    }
    EXPECT_EQ(s["motor_share"]["mu_required_max"]["real"], s["mu_required"]["max"]);
  }
}

TEST(Run, ListsRegimesAndImpactsOfAHop) {
  const Folder folder;
  const Outcome run = folder.run("ballast run hop --out r");
  EXPECT_EQ(run.exit_status, 3) << run.err;  // it left the ground
  const auto s = folder.summary("r");
  EXPECT_EQ(s["end"]["reason"], "completed");
  ASSERT_EQ(s["regimes"].size(), 5u);
  double end = 0;
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(s["regimes"][i]["regime"], i % 2 == 0 ? "rolling" : "flight");
    EXPECT_EQ(s["regimes"][i]["start"], end);
    end = s["regimes"][i]["end"];
  }
  EXPECT_EQ(end, 2.5);
  EXPECT_EQ(s["regimes"][1]["start"], 0.2);  // where the mass is braked
  EXPECT_GT(s["impacts"].size(), 4u);
  EXPECT_TRUE(s["impacts"][0]["sticking"]);
  EXPECT_GT(s["impacts"][0]["normal_impulse"], 0);
  EXPECT_EQ(s["trip"]["cause"], "normal_force");
}

// Without the motor's ripple the ball follows its seam: f_s / N is that of the prescribed run and what steps add.
TEST(Run, SeamBallRunsOnceRoundItsSpline) {
  const Folder folder;
  ASSERT_EQ(folder.run("ballast run seam_ball --quiet --out r").exit_status, 0);
  ASSERT_EQ(folder.run("ballast run seam_ball --quiet --out p --actuation prescribed").exit_status, 0);
  const auto s = folder.summary("r"), p = folder.summary("p");
  EXPECT_EQ(s["motors"][0]["lost_steps"], 0);
  EXPECT_EQ(p["motors"][0]["steps"], 0);
  EXPECT_GT(p["motors"][0]["max_torque"], 0);
  // The motor lags by up to a tooth's quarter under full torque, 1/200 turn or 0.5 mm; it has a margin of a half.
  const double end = p["final"]["mass_position"][0];
  EXPECT_NEAR(s["final"]["mass_position"][0].get<double>(), end, 2.5e-4);
  EXPECT_LT(s["mu_required"]["max"], 0.1);
  // Once round, and the path is 1.5 times the rail: its ends are 1.25 m apart (the seam rolled out on paper).
  const double x = p["final"]["position"][0], y = p["final"]["position"][1];
  EXPECT_LT(std::hypot(x, y), 1.5 * end);
  EXPECT_GT(std::hypot(x, y), 1.5 * end / 2);
}

TEST(Run, AMassOnATrajectoryHasTheTimeAsItsCoordinateAndNoMotor) {
  const Folder folder;
  const Outcome run = folder.run("ballast run tumbleweed --out r");
  ASSERT_EQ(run.exit_status, 0) << run.err;
  EXPECT_EQ(run.out.find("torque margin"), std::string::npos);
  const auto s = folder.summary("r");
  EXPECT_EQ(s["final"]["mass_position"][0], 36);
  EXPECT_EQ(s["final"]["mass_velocity"][0], 1);
  ASSERT_EQ(s["motors"].size(), 1u);
  EXPECT_TRUE(s["motors"][0].is_null());
  const Outcome stepper = folder.run("ballast run tumbleweed --out q --actuation stepper");
  EXPECT_EQ(stepper.exit_status, 1);
  EXPECT_NE(stepper.err.find("run.actuation = \"prescribed\""), std::string::npos) << stepper.err;
}

TEST(Run, AStartInSlidingIsNoViolation) {
  const Folder folder;
  EXPECT_EQ(folder.run("ballast run slide_to_roll --out r").exit_status, 0);
  const auto s = folder.summary("r");
  ASSERT_EQ(s["regimes"].size(), 2u);
  EXPECT_EQ(s["regimes"][0]["regime"], "sliding");
  EXPECT_EQ(s["trip"], nullptr);
  EXPECT_TRUE(s["surfaces"].empty()) << "it did not start rolling, and says nothing of other floors";
}

// The controller stops the masses after the slip has been seen, and the ball slides and rolls on until they rest.
TEST(Run, ASlipTripsAndTheRunGoesOnUntilTheMassesRest) {
  const Folder folder;
  EXPECT_EQ(folder
                .run("ballast run paper_ball --set surface.static_friction=0.17 "
                     "--set run.on_violation=continue --out r")
                .exit_status,
            3);
  const auto s = folder.summary("r");
  EXPECT_EQ(s["end"]["reason"], "tripped");
  EXPECT_EQ(s["trip"]["cause"], "friction");
  EXPECT_GE(s["regimes"].size(), 2u);
}

TEST(Run, StatesThePapersNumberBesideItsOwn) {
  const Folder folder;
  const Outcome run = folder.run("ballast run paper_detach --actuation prescribed --out r");
  EXPECT_EQ(run.exit_status, 3);
  EXPECT_NE(run.out.find("3.7358"), std::string::npos) << run.out;
  const auto s = folder.summary("r");
  EXPECT_EQ(s["end"]["reason"], "detached");
  EXPECT_NEAR(s["end"]["time"], 3.6095, 0.5e-4);
  EXPECT_EQ(s["mu_required"]["max"], nullptr);  // no friction is enough where N = 0
  EXPECT_EQ(s["published"][0]["published"], 3.7358);
  EXPECT_EQ(s["published"][0]["here"], s["end"]["time"]);
}

TEST(Run, DeskBallStaysInsideItsEnvelope) {
  const Folder folder;
  EXPECT_EQ(folder.run("ballast run desk_ball --quiet --out r").exit_status, 0);
  const auto s = folder.summary("r");
  EXPECT_LT(s["mu_required"]["max"], 0.5);
  EXPECT_GT(s["final"]["position"][0], 0.1);  // it goes somewhere
  for (const auto& motor : s["motors"]) {
    EXPECT_EQ(motor["lost_steps"], 0);
    EXPECT_LT(std::abs(motor["steps_behind"].get<double>()), 16);  // its lag under load: less than a full step
    // 10 s of the rated current's heat, 2 I^2 R, from a supply that can drive it throughout; and the balance, to what
    // Simpson's rule leaves.
    const auto& energy = motor["energy"];
    EXPECT_NEAR(energy["copper_loss"].get<double>(), 90, 1e-8);
    const double out = energy["copper_loss"].get<double>() + energy["friction_loss"].get<double>() +
                       energy["work"].get<double>() + energy["stored"].get<double>();
    EXPECT_NEAR(energy["electrical"].get<double>(), out, 1e-8 * 90);
  }
}

TEST(Run, ABallWithoutMassesRolls) {
  const Folder folder;
  folder.write("ball.toml", kBall.substr(0, kBall.find("[[mass]]")) + "[initial]\nangular_velocity = [0, 1, 0]\n");
  for (const std::string actuation : {"stepper", "prescribed"}) {
    EXPECT_EQ(folder.run("ballast run ball.toml --out r --actuation " + actuation).exit_status, 0);
    // zdot = omega x r e3: a homogeneous ball keeps its speed.
    EXPECT_NEAR(folder.summary("r")["final"]["position"][0], 0.2, 1e-12);
  }
}

TEST(Run, EndsInsideATickAreKept) {
  const Folder folder;
  folder.write("ball.toml", kBall);
  ASSERT_EQ(
      folder.run("ballast run ball.toml --out r --set duration=0.1234567 --set run.control_period=0.01").exit_status,
      0);
  EXPECT_EQ(folder.summary("r")["end"]["time"], 0.1234567);
}

struct BadInput {
  const char* name;
  std::string arguments;  // of ballast run; ball.toml is a good scenario
  int exit_status;
  std::string says;  // part of the message
};

class BadInputTest : public testing::TestWithParam<BadInput> {};

TEST_P(BadInputTest, IsRefusedWithOneClearMessageAndNoResults) {
  const Folder folder;
  folder.write("ball.toml", kBall);
  folder.write("broken.toml", "duration = = 3\n");
  folder.write("unknown.toml", kBall + "frikction = 1\n");
  folder.write("file", "not a folder");
  const int before = folder.entries();
  const Outcome run = folder.run("ballast run " + GetParam().arguments);
  EXPECT_EQ(run.exit_status, GetParam().exit_status) << run.err;
  EXPECT_NE(run.err.find(GetParam().says), std::string::npos) << run.err;
  EXPECT_EQ(run.out, "");
  EXPECT_LE(std::count(run.err.begin(), run.err.end(), '\n'), 3) << run.err;
  EXPECT_EQ(folder.entries(), before) << "something was left behind";
}

INSTANTIATE_TEST_SUITE_P(
    Run, BadInputTest,
    testing::Values(
        BadInput{"NegativeMass", "ball.toml --set mass.0.mass=-1", 1, "mass.0.mass = -1"},
        BadInput{"ZeroInertia", "ball.toml --set ball.inertia=[0,0,0]", 1, "ball.inertia"},
        BadInput{"TriangleInequality", "ball.toml --set ball.inertia=[1,1,3]", 1, "ball.inertia"},
        BadInput{"NonUnitQuaternion", "ball.toml --set initial.orientation=[1,1,0,0]", 1, "initial.orientation"},
        BadInput{"MassOutsideTheBall", "ball.toml --set mass.0.rail.radius=1.5", 1, "mass.0.rail"},
        BadInput{"UnknownKey", "unknown.toml", 1, "frikction"},
        BadInput{"UnknownKeySet", "ball.toml --set gravitation=2", 1, "gravity"},
        BadInput{"WrongType", "ball.toml --set gravity='\"much\"'", 1, "gravity"},
        BadInput{"NaN", "ball.toml --set gravity=nan", 1, "gravity = nan"},
        BadInput{"MissingFile", "nowhere.toml", 1, "nowhere.toml"}, BadInput{"Folder", ".", 1, "."},
        BadInput{"BrokenToml", "broken.toml", 1, "broken.toml:1"},
        BadInput{"NineMasses",
                 "ball.toml --set mass='" +
                     [] {
                       std::string list = "[";
                       for (int i = 0; i < 9; ++i) {
                         list += "{mass=0.1,rail={shape=\"circle\",radius=0.1,direction={azimuth=0,elevation=0}}},";
                       }
                       return list + "]'";
                     }(),
                 1, "8"},
        BadInput{"ZeroPeriod", "ball.toml --set run.control_period=0", 1, "run.control_period = 0"},
        BadInput{"EmptyPiece", "ball.toml --set mass.0.motion.0.duration=0", 1, "mass.0.motion.0.duration = 0"},
        BadInput{"BadSet", "ball.toml --set gravity", 1, "gravity"},
        BadInput{"UnknownOption", "ball.toml --frobnicate", 1, "--frobnicate"},
        BadInput{"UnknownActuation", "ball.toml --actuation magic", 1, "magic"},
        BadInput{"NegativeSeed", "ball.toml --seed -1", 1, "--seed: -1 is no seed; allowed: an integer from 0"},
        BadInput{"SeedTooLarge", "ball.toml --seed 9223372036854775808", 1, "--seed: 9223372036854775808 is no seed"},
        BadInput{"NegativeSpeed", "ball.toml --speed -1", 1, "--speed: -1 is out of range"},
        BadInput{"NoSpeed", "ball.toml --speed 0", 1, "--speed: 0 is out of range"},
        BadInput{"SpeedNaN", "ball.toml --speed nan", 1, "--speed: nan is out of range; allowed: a finite number > 0"},
        BadInput{"SpeedInfinite", "ball.toml --speed inf", 1, "--speed: inf is out of range"},
        BadInput{"StartTimeoutNaN", "ball.toml --start-timeout nan", 1, "--start-timeout: nan is out of range"},
        BadInput{"PeerTimeoutInfinite", "ball.toml --peer-timeout inf", 1, "--peer-timeout: inf is out of range"},
        BadInput{"EmptySet", "ball.toml --set ''", 1, "--set: is empty"},
        BadInput{"EmptyOut", "ball.toml --out ''", 1, "--out: is empty"},
        BadInput{"EmptyBus", "ball.toml --lcm ''", 1, "--lcm: is empty"},
        BadInput{"MisspeltScenario", "paper_bal", 1, "did you mean paper_ball?"},
        BadInput{"PositionBeyondCounting", "ball.toml --set mass.0.initial_position=1e15", 1,
                 "--set: mass.0.initial_position = 1e15"},
        BadInput{"NoScenario", "", 1, "SCENARIO"},
        BadInput{"OutputUnderAFile", "ball.toml --out file/results", 2, "file/results"},
        BadInput{"OutputIsAFile", "ball.toml --out file", 2, "file: is a file; allowed: a folder"},
        BadInput{"ElfForTheHost", "ball.toml --firmware-elf file", 1, "--firmware-elf: not with --firmware host"},
        // The run's parts are checked after its folder was made.
        BadInput{"NoElf", "paper_ball --firmware qemu --firmware-elf nowhere.elf --out e/f/", 2, "nowhere.elf"},
        BadInput{"ElfThatIsNone", "paper_ball --firmware qemu --firmware-elf file --out e", 2, "file: is no program"},
        BadInput{"OutputOnProc", "ball.toml --out /proc/results", 2, "/proc/results"},
        BadInput{"BadBus", "ball.toml --lcm nonsense://", 2, "nonsense://"}),
    [](const auto& bad) { return std::string(bad.param.name); });

// Files may not grow beyond 64 blocks of 512 bytes: what a full disk is to the program.
TEST(Run, AFullDiskIsReportedAndKeepsTheLogUpToThere) {
  const Folder folder;
  for (const std::string& how : {std::string(), " --processes --lcm '" + test::bus_url(26) + "'"}) {
    SCOPED_TRACE(how);
    const Outcome run =
        folder.run("(trap '' XFSZ; ulimit -f 64; ballast run paper_ball --set duration=2 --out r" + how + ")");
    EXPECT_EQ(run.exit_status, 2);
    EXPECT_NE(run.err.find("run.lcmlog: cannot be written: File too large; the run ended at t = "), std::string::npos)
        << run.err;
    EXPECT_NE(run.err.find("Kept: r/run.lcmlog, as far as it could be written. Lost: "), std::string::npos) << run.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "r/summary.json"));
    EXPECT_FALSE(std::filesystem::exists(folder / "r/blackbox"));
    EXPECT_EQ(std::filesystem::file_size(folder / "r/run.lcmlog"), 64u * 512);
    const Outcome replay = folder.run("ballast replay r --verify");
    EXPECT_EQ(replay.exit_status, 0) << replay.err;
    EXPECT_NE(replay.out.find("the log ends early: cut off inside an event"), std::string::npos) << replay.out;
  }
}

// In the background and under way: its log grows. `$run` is its process. Waited for at most 30 s.
std::string started(const std::string& command, const std::string& log) {
  return "(" + command + ") & run=$!; i=0; while [ $i -lt 300 ] && [ \"$(stat -c %s " + log +
         " 2>/dev/null || echo 0)\" -le 100000 ]; do sleep 0.1; i=$((i + 1)); done; ";
}

// The second run leaves the first one's files alone, and says so; a killed run locks nobody out.
TEST(Run, AFolderTakesOneRunAtATime) {
  const Folder folder;
  folder.write("ball.toml", kBall);
  const Outcome run =
      folder.run(started("exec ballast run paper_ball --set duration=600 --speed 1 --out r", "r/run.lcmlog") +
                 "ln -s r link;"
                 "ballast run ball.toml --out r; echo second $?;"
                 "ballast run ball.toml --out link/../r; echo third $?;"
                 "ballast move paper_ball --all 1 --out link; echo move $?;"
                 "ballast integrate ball.toml --out r; echo integrate $?;"
                 "cp r/scenario.toml while.toml; kill -9 $run; wait $run;"
                 "ballast run ball.toml --quiet --out r; echo after $?");
  EXPECT_EQ(run.out, "second 2\nthird 2\nmove 2\nintegrate 2\nafter 0\n") << run.err;
  EXPECT_NE(run.err.find("ballast: r: another run is writing there; allowed: another folder (--out)"),
            std::string::npos)
      << run.err;
  EXPECT_NE(read_file(folder / "while.toml").find("duration = 600"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder / "r/integrators.json"));
}

// A terminal that is closed says so to what runs in it, and its shell says it once more.
TEST(Run, AClosedTerminalEndsItWithAWholeLog) {
  const Folder folder;
  const std::string run = "ballast run paper_ball --set duration=600 --speed 1 --quiet --out r";
  const Outcome closed = folder.run(started("exec env --default-signal=HUP " + run, "r/run.lcmlog") +
                                    "kill -HUP $run; kill -HUP $run; wait $run; echo $?");
  EXPECT_EQ(closed.out, "2\n") << closed.err;
  EXPECT_NE(closed.err.find("ballast: interrupted; r/run.lcmlog holds"), std::string::npos) << closed.err;
  const Outcome replay = folder.run("ballast replay r --verify");
  EXPECT_EQ(replay.exit_status, 0) << replay.out << replay.err;
  EXPECT_EQ(replay.out.find("ends early"), std::string::npos) << replay.out;
  // Under nohup it is to go on.
  const Outcome nohup = folder.run(started("trap '' HUP; exec " + run + "2", "r2/run.lcmlog") +
                                   "kill -HUP $run; sleep 0.5; kill -0 $run && echo there; kill -TERM $run; wait $run");
  EXPECT_EQ(nohup.out, "there\n") << nohup.err;
}

TEST(Faults, AreListedAndEachOfThemIsOnThePage) {
  const Folder folder;
  const Outcome list = folder.run("ballast faults");
  EXPECT_EQ(list.exit_status, 0) << list.err;
  std::ifstream page(BALLAST_FAULT_PAGE);
  const std::string text{std::istreambuf_iterator<char>(page), {}};
  int kinds = 0;
  for (const sim::FaultKindInfo& kind : sim::fault_kinds()) {
    EXPECT_NE(list.out.find(std::string("  ") + kind.name + " "), std::string::npos) << kind.name;
    // By its name, or by the end of it after another of its family: `peer_killed`, `_frozen`.
    const std::string name = kind.name;
    const std::string end = std::string("`").append(name, std::min(name.find('_'), name.size())) + "`";
    EXPECT_TRUE(text.find("`" + name + "`") != std::string::npos || text.find(end) != std::string::npos) << name;
    ++kinds;
  }
  EXPECT_EQ(kinds, 26);
  EXPECT_NE(list.out.find("With --processes these are signals"), std::string::npos) << list.out;
}

TEST(Faults, AreRunAndWrittenDown) {
  const Folder folder;
  const Outcome run = folder.run("ballast run paper_ball --set duration=1 --fault sensor_bias@0.5:0.1,axis=1 --out r");
  EXPECT_EQ(run.exit_status, 0) << run.err;
  EXPECT_NE(run.out.find("fault       sensor_bias at 0.5 s"), std::string::npos) << run.out;
  EXPECT_EQ(folder.run("ballast run r/scenario.toml --out again --quiet").exit_status, 0);
  EXPECT_EQ(folder.run("cmp r/run.lcmlog again/run.lcmlog").exit_status, 0);
  EXPECT_EQ(folder.run("ballast replay r --verify").exit_status, 0);
}

// Exit statuses, and what is said; never ignored.
TEST(Faults, EndAsTheySay) {
  const Folder folder;
  struct Case {
    const char* arguments;
    int exit_status;
    const char* said;
  };
  const Case cases[] = {
      {"ballast run paper_ball --fault motor_stal@1", 1, "did you mean motor_stall?"},
      {"ballast check paper_ball --fault motor_stal@1", 1, "did you mean motor_stall?"},
      {"ballast run paper_ball --actuation prescribed --fault motor_stall@1", 1, "acts on a motor"},
      {"ballast run paper_ball --fault controller_overrun@1 --processes", 1, "cannot be injected with --processes"},
      {"ballast run paper_ball --fault peer_killed@1 --processes --check-steps", 1,
       "cannot be injected with --check-steps"},
      {"ballast run paper_ball --fault peer_killed@1 --firmware qemu", 1, "cannot be injected with --firmware qemu"},
      {"ballast run paper_ball --fault peer_killed@1 --check-steps", 1, "cannot be injected with --check-steps"},
      {"ballast friction paper_ball --fault push@1:1", 1, "not with ballast friction"},
      {"ballast integrate paper_ball --fault push@1:1", 1, "not with ballast integrate"},
      {"ballast run paper_ball --fault peer_killed@1 --out a", 2, "controller lost"},
      {"ballast run paper_ball --fault peer_killed@1:peer=monitor --out b", 3, ""},
      {"ballast run paper_ball --fault controller_overrun@1 --out c", 6, "overruns"},
      {"ballast run paper_ball --fault disk_full@1 --out d", 2, "No space left on device (as asked: disk_full at 1 s)"},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.arguments);
    const Outcome run = folder.run(c.arguments);
    EXPECT_EQ(run.exit_status, c.exit_status) << run.err;
    EXPECT_NE(run.err.find(c.said), std::string::npos) << run.err;
  }
  EXPECT_GT(std::filesystem::file_size(folder / "d/run.lcmlog"), 100'000u);
  EXPECT_FALSE(std::filesystem::exists(folder / "d/blackbox"));  // there is no room for it
}

// The program that draws stands beside this one, wherever that is: here in a folder a shell's line has to quote.
TEST(Run, PicturesAreDrawnByTheProgramBesideItWhateverItsPath) {
  const Folder folder;
  folder.write("ball.toml", kBall);
  const Outcome run = folder.run(
      "mkdir \"it's \\$HOME\" && cd \"it's \\$HOME\" && cp \"$(command -v ballast)\" . && "
      "printf '#!/bin/sh\\necho drawn into \"$1\"\\n' >ballast-plot && chmod +x ballast-plot && "
      "./ballast run ../ball.toml --out \"o'ut\" --pictures --quiet");
  EXPECT_EQ(run.exit_status, 0) << run.err;
  EXPECT_NE(run.out.find("drawn into "), std::string::npos) << run.out << run.err;
  EXPECT_NE(run.out.find("it's $HOME/o'ut"), std::string::npos) << run.out << run.err;
}

// A mass on the level of the centre, held: it rolls the ball, so all the friction is its weight's, and the ball needs
// the more the further out it is. As TwoMassesByHand of the physics tests: A = d + M r^2 + m x^2, Omegadot = m g x / A,
// f_s = M r Omegadot, N = M g - m x Omegadot.
TEST(Friction, SaysHowMuchWhenAndBecauseOfWhom) {
  const Folder folder;
  folder.write("held.toml", R"(name = "held"
duration = 0.002
gravity = 10.0
[ball]
radius = 0.5
mass = 2.0
inertia = [0.3, 0.3, 0.3]
[[mass]]
mass = 1.0
rail = { shape = "line", origin = [0, 0, 0], direction = [1, 0, 0] }
initial_position = 0.3
[mass.motor]
travel_per_revolution = 0.01
[run]
actuation = "prescribed"
)");
  const double inertia = 0.3 + 3 * 0.25 + 0.09, turn = 10 * 0.3 / inertia;
  const double mu = 3 * 0.5 * turn / (30 - 0.3 * turn);
  char needs[32];
  std::snprintf(needs, sizeof needs, "needs %.3g at", mu);
  const Outcome friction = folder.run("ballast friction held.toml");
  EXPECT_EQ(friction.exit_status, 0) << friction.err;
  EXPECT_NE(friction.out.find(needs), std::string::npos) << friction.out << needs;
  EXPECT_NE(friction.out.find("because of mass 0 (100 %); rolls on"), std::string::npos) << friction.out;
  EXPECT_EQ(folder.entries(), 1) << "it leaves no files";
  // Slides before it is thrown off: less than aluminium gives, and yet no floor is named.
  const Outcome thrown = folder.run("ballast run paper_detach_flight --out thrown");
  EXPECT_NE(thrown.out.find("needs at least 0.35 at"), std::string::npos) << thrown.out;
  EXPECT_NE(thrown.out.find("; rolls on none of the paper's floors: N falls to 0 at 4."), std::string::npos)
      << thrown.out;

  // A floor that does not give it ends the run; what is needed is still said, and the run says up to where it speaks.
  const Outcome run = folder.run("ballast run held.toml --out r --set surface.static_friction=0.1");
  EXPECT_EQ(run.exit_status, 3);
  EXPECT_NE(run.out.find("needs at least"), std::string::npos) << run.out;
  EXPECT_EQ(folder.run("ballast friction held.toml --set surface.static_friction=0.1").out, friction.out);
  const auto needed = folder.summary("r")["required_friction"];
  EXPECT_NE(run.out.find(needed["text"].get<std::string>()), std::string::npos);
  EXPECT_EQ(needed["parts"][0]["of"], "mass 0");
  EXPECT_NEAR(needed["parts"][0]["part"].get<double>(), 1, 1e-12);  // rounding
  EXPECT_NEAR(needed["static_friction"].get<double>(), 3 * 0.5 * turn, 1e-12);
}

TEST(Friction, ABallThatLeavesTheGroundIsNotHelpedByAny) {
  const Folder folder;
  const Outcome friction = folder.run("ballast friction hop");
  EXPECT_EQ(friction.exit_status, 3);
  EXPECT_NE(friction.out.find("leaves the ground at 0.2 s on any floor because of mass 0 (100 %)"), std::string::npos)
      << friction.out;
  EXPECT_EQ(folder.run("ballast friction hop --set mass.0.mass=-1").exit_status, 1);
}

// The same hop with the mass beside the centre, so that rolling needs f_s > 0 all the way to N = 0: a real floor slips
// before the ball leaves it.
TEST(Friction, ABallThatIsPushedWhileNFallsNeedsMoreThanAnyFloorGives) {
  const Folder folder;
  const Outcome friction = folder.run("ballast friction hop --set 'mass.0.rail.origin=[0.02,0,0]'");
  EXPECT_EQ(friction.exit_status, 3) << friction.err;
  EXPECT_NE(friction.out.find("needs more friction than any floor gives at 0.2 s: N falls to 0"), std::string::npos)
      << friction.out;
  EXPECT_EQ(friction.out.find("leaves the ground"), std::string::npos) << friction.out;
}

TEST(Friction, ARunThatEndedEarlySaysUpToWhereItKnows) {
  const Folder folder;
  folder.write("stop.toml", test::kIntoItsStop);
  const Outcome friction = folder.run("ballast friction stop.toml");
  EXPECT_EQ(friction.exit_status, 3) << friction.err;
  const Outcome run = folder.run("ballast run stop.toml --out r");
  char end[96];
  std::snprintf(end, sizeof end, "; up to its end at %.4g s (tripped by the controller) rolls on",
                folder.summary("r")["end"]["time"].get<double>());
  for (const Outcome& said : {friction, run}) {
    EXPECT_NE(said.out.find("needs at least "), std::string::npos) << said.out;
    EXPECT_NE(said.out.find(end), std::string::npos) << said.out << end;
    EXPECT_NE(said.out.find("motor 0 lost "), std::string::npos) << said.out;
  }
}

TEST(Friction, ARunThatDoesNotStartRollingSaysNothingOfFloors) {
  const Folder folder;
  const Outcome run = folder.run("ballast run slide_to_roll --out r");
  for (const std::string& said : {run.out, folder.run("ballast friction slide_to_roll").out}) {
    EXPECT_NE(said.find("does not start rolling, so other floors are not judged"), std::string::npos) << said;
    EXPECT_EQ(said.find("of the paper's floors"), std::string::npos) << said;
    EXPECT_EQ(said.find("needs no friction"), std::string::npos) << said;
  }
}

TEST(Move, GoesThereAndSaysWhatItDoes) {
  const Folder folder;
  const Outcome move = folder.run("ballast move paper_ball --mass 1 --to 2.2 --speed-fraction 0.3 --set duration=10");
  EXPECT_EQ(move.exit_status, 0) << move.err;
  EXPECT_NE(move.out.find("predicted, masses as commanded: "), std::string::npos) << move.out;
  EXPECT_EQ(move.out.find("WARNING"), std::string::npos) << move.out;
  const auto s = folder.summary("runs/paper_ball-move");
  EXPECT_EQ(s["end"]["reason"], "completed");
  EXPECT_LT(s["end"]["time"], 10.0) << "ends when the mass rests";
  EXPECT_EQ(s["stop"], nullptr);
  EXPECT_EQ(s["move"]["start"], 0.007) << "pending for seven ticks";
  EXPECT_GT(s["end"]["time"], s["move"]["duration"]);
  // 2.2 - 2.0369 rad of 3200 microsteps a turn.
  EXPECT_EQ(s["motors"][1]["steps"], 83);
  EXPECT_EQ(s["motors"][0]["steps"], 0);
  // Where the field has it, but for the lag under its load, a full step at most.
  EXPECT_NEAR(s["final"]["mass_position"][1].get<double>(), 2.2, 2 * M_PI / 200);
  // Slowly, the motors follow smoothly: what is seen differs from the prediction by microsteps and lag only.
  EXPECT_NEAR(s["move"]["margin_min"].get<double>(), s["move"]["predicted_margin_min"].get<double>(), 0.05);
  EXPECT_TRUE(s["published"].empty()) << "they speak of the scenario's own motion";
  EXPECT_NE(move.out.find("arrived     mass 1 at 2.2"), std::string::npos) << move.out;
  EXPECT_EQ(s["move_end"]["arrived"], true);
  EXPECT_EQ(s["move_end"]["masses"][0]["asked"], nullptr);
  EXPECT_EQ(s["move_end"]["masses"][1]["asked"], 2.2);
  EXPECT_EQ(s["move_end"]["masses"][1]["position"], s["final"]["mass_position"][1]);
}

// How long a move takes is its own affair.
TEST(Move, OneThatTakesForEverIsRefused) {
  const Folder folder;
  const Outcome move = folder.run("ballast move paper_ball --mass 1 --to 2.5 --speed-fraction 1e-9 --out r");
  EXPECT_EQ(move.exit_status, 1);
  EXPECT_NE(move.err.find("allowed: at most 600 s"), std::string::npos) << move.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "r"));
}

TEST(Move, IsNotCutShortByTheScenariosDuration) {
  const Folder folder;
  const Outcome move = folder.run("ballast move paper_ball --mass 1 --to 2.2 --speed-fraction 0.3 --set duration=0.1");
  EXPECT_EQ(move.exit_status, 0) << move.err;
  const auto s = folder.summary("runs/paper_ball-move");
  EXPECT_GT(s["move"]["duration"], 0.1);
  EXPECT_GT(s["end"]["time"], s["move"]["duration"]);
  EXPECT_EQ(s["move_end"]["arrived"], true);
  EXPECT_EQ(s["motors"][1]["steps"], 83);  // as in GoesThereAndSaysWhatItDoes
}

// On glass it slips on the way.
TEST(Move, OneThatWillBreakTheEnvelopeIsSaidToBeforeAndWhereItEndedAfter) {
  const Folder folder;
  const std::string line = "ballast move paper_ball --mass 1 --to 0 --set surface.static_friction=0.17 --out m";
  const Outcome move = folder.run(line);
  EXPECT_EQ(move.exit_status, 3);
  EXPECT_NE(move.err.find("ballast: the move is predicted to break the envelope: least margin -"), std::string::npos)
      << move.err;
  EXPECT_NE(move.out.find("NOT THERE   mass 1 at "), std::string::npos) << move.out;
  EXPECT_NE(move.out.find("(asked: 0, -"), std::string::npos) << move.out;
  EXPECT_EQ(folder.summary("m")["move_end"]["arrived"], false);
  const Outcome quiet = folder.run(line + " --quiet");
  EXPECT_EQ(quiet.out, "");
  EXPECT_NE(quiet.err.find("the move did not arrive: mass 1 at "), std::string::npos) << quiet.err;
  // The monitor's limits count, not the floor's alone.
  const Outcome limited =
      folder.run("ballast move paper_ball --mass 1 --to 2.2 --set envelope.friction_use=0.001 --quiet --out m");
  EXPECT_EQ(limited.exit_status, 3);
  EXPECT_NE(limited.err.find("; allowed: >= 0.999\n"), std::string::npos) << limited.err;
  // The cause of the trip is among the recorded values: f_s / N, by the floor's mu_s. The trip knows the peak between
  // two ticks, the samples do not: half of it is enough to tell it from the rest before.
  const auto tripped = folder.summary("m");
  EXPECT_LT(tripped["move"]["margin_min"].get<double>(), 1 - 0.5 * tripped["trip"]["value"].get<double>() / 0.35);
}

TEST(Move, ARefusedOneLeavesWhatAnEarlierOneHasLeft) {
  const Folder folder;
  folder.write("ball.toml", kBall);
  ASSERT_EQ(folder.run("ballast move ball.toml --all 0.1 --quiet --out m").exit_status, 0);
  const auto before = folder.summary("m");
  EXPECT_EQ(folder.run("ballast move ball.toml --all 1e14 --out m").exit_status, 1);
  EXPECT_EQ(folder.summary("m"), before);
  EXPECT_TRUE(std::filesystem::exists(folder / "m/run.lcmlog"));
  EXPECT_EQ(folder.run("ballast move ball.toml --all 1e14 --out new").exit_status, 1);
  EXPECT_FALSE(std::filesystem::exists(folder / "new"));
}

// At the default rate the torque carries the drag; somebody who allows more loses steps, and the summary does not keep
// that to itself.
TEST(Move, LostStepsAreSaidPlainly) {
  const Folder folder;
  const std::string line = "ballast move paper_ball --mass 1 --to 2.5 --set duration=10";
  const Outcome carried = folder.run(line + " --quiet");
  EXPECT_EQ(carried.exit_status, 0);
  EXPECT_EQ(carried.out + carried.err, "");
  const std::string too_fast = line + " --set mass.1.motor.max_step_rate=27000";
  const Outcome move = folder.run(too_fast);
  EXPECT_NE(move.exit_status, 0) << "it is not where it was to be";
  const auto s = folder.summary("runs/paper_ball-move");
  ASSERT_GT(s["motors"][1]["lost_steps"], 0);
  const std::string lost = "motor 1 lost " + std::to_string(s["motors"][1]["lost_steps"].get<int>()) + " microsteps";
  EXPECT_NE(move.out.find("WARNING     " + lost), std::string::npos) << move.out;
  EXPECT_NE(move.out.find("--speed-fraction"), std::string::npos) << move.out;
  EXPECT_NE(move.out.find("NOT THERE   mass 1 at "), std::string::npos) << move.out;
  const Outcome quiet = folder.run(too_fast + " --quiet");
  EXPECT_EQ(quiet.out, "");
  EXPECT_NE(quiet.err.find(lost), std::string::npos) << quiet.err;
}

// As fast as their motors allow by default, on the robots that ship with motors: nothing is lost.
TEST(Move, AtFullSpeedLosesNoSteps) {
  const Folder folder;
  for (const std::string line : {"paper_ball --mass 1 --to 2.5", "paper_ball --mass 0 --to -0.5",
                                 "paper_disk --mass 2 --to 1", "desk_ball --mass 0 --to 1.5", "seam_ball --all 0.3"}) {
    folder.run("ballast move " + line + " --set duration=60 --quiet --out m");
    const auto s = folder.summary("m");
    EXPECT_EQ(s["end"]["reason"], "completed") << line;
    for (const auto& motor : s["motors"]) {
      EXPECT_EQ(motor["lost_steps"], 0) << line;
      EXPECT_GT(motor["torque_margin"], 0.05) << line;
    }
  }
}

TEST(Move, AllAndOneOtherwise) {
  const Folder folder;
  ASSERT_EQ(folder.run("ballast move desk_ball --all 0.1 --mass 2 --to 0 --speed-fraction 0.05 --force --quiet --out m")
                .exit_status,
            0);
  const auto s = folder.summary("m");
  EXPECT_GT(s["motors"][0]["steps"], 0);
  EXPECT_EQ(s["motors"][0]["steps"], s["motors"][1]["steps"]);
  EXPECT_EQ(s["motors"][2]["steps"], 0);
}

TEST(Move, IsRefusedWithAReason) {
  const Folder folder;
  folder.write("ball.toml", kBall);
  for (const auto& [line, reason] :
       {std::pair("ball.toml --mass 0 --to nan", "mass 0: the target nan"),
        std::pair("ball.toml --mass 0 --to 1e300", "mass 0: the target 1e+300"),
        std::pair("ball.toml --mass 1 --to 1", "--mass 1"), std::pair("ball.toml --mass -1 --to 1", "--mass -1"),
        std::pair("ball.toml --mass 0", "in pairs"),
        std::pair("ball.toml --mass 0 --to 1 --mass 0 --to 2", "--mass 0: is given more than once"),
        std::pair("ball.toml", "no mass is named"),
        std::pair("ball.toml --all 1 --speed-fraction 2", "speed fraction 2"),
        std::pair("ball.toml --all 1 --actuation prescribed", "no controller"),
        std::pair("ball.toml --all 1 --set mass.0.initial_velocity=1", "mass.0.initial_velocity"),
        std::pair("ball.toml --all 1 --set mass.0.motor.max_jerk=9", "mass.0.motion.0")}) {
    const Outcome move = folder.run(std::string("ballast move ") + line);
    EXPECT_EQ(move.exit_status, 1) << line;
    EXPECT_NE(move.err.find(reason), std::string::npos) << line << ": " << move.err;
    EXPECT_EQ(move.out, "") << line;
  }
}

// Two full steps before an end, 0.5 mm here, the rotor's swing does not close its switch, in full steps either. From
// there on a move is refused, by mass, end, target and what is allowed.
TEST(Move, GoesAsCloseToAnEndStopAsTheRotorMaySwing) {
  const Folder folder;
  folder.write("line.toml", test::kIntoItsStop);
  const std::string strong =
      "ballast move line.toml --set mass.0.motor.holding_torque=0.2 "
      "--set surface.static_friction=inf --quiet --out m ";
  for (const std::string microsteps : {"1", "16"}) {
    const std::string line = strong + "--set mass.0.motor.microsteps=" + microsteps + " --mass 0 --to ";
    for (const std::string target : {"0.1495", "-0.0195"}) {
      const Outcome move = folder.run(line + target);
      EXPECT_EQ(move.exit_status, 0) << microsteps << ", " << target << ": " << move.err;
      EXPECT_EQ(folder.summary("m")["move_end"]["arrived"], true);
      EXPECT_EQ(folder.summary("m")["motors"][0]["end_stop"], nullptr) << "it has touched its stop";
    }
    for (const std::string target : {"0.1496", "0.15", "0.2"}) {
      const Outcome move = folder.run(line + target);
      EXPECT_EQ(move.exit_status, 1);
      EXPECT_NE(move.err.find("mass 0: the target " + target +
                              " is beyond the upper end of its rail or too close to it; "
                              "allowed: at most 0.1495,"),
                std::string::npos)
          << move.err;
    }
    const Outcome move = folder.run(line + "-0.02");
    EXPECT_EQ(move.exit_status, 1);
    EXPECT_NE(
        move.err.find("the target -0.02 is beyond the lower end of its rail or too close to it; allowed: at least "
                      "-0.0195,"),
        std::string::npos)
        << move.err;
  }
}

// A value that a refusal names as allowed can be typed back, however many digits it has.
TEST(Move, ToWhatARefusalAllows) {
  const Folder folder;
  folder.write("line.toml", test::kIntoItsStop);
  const std::string line =
      "ballast move line.toml --set 'mass.0.rail.end_stops=[-0.02,0.14513131313131313]' --set "
      "mass.0.motor.holding_torque=0.2 "
      "--set surface.static_friction=inf --quiet --out m --mass 0 --to ";
  const std::string refused = folder.run(line + "1").err;
  const std::string before = "allowed: at most ";
  const auto at = refused.find(before);
  ASSERT_NE(at, std::string::npos) << refused;
  const auto begin = at + before.size();
  const Outcome move = folder.run(line + refused.substr(begin, refused.find(',', begin) - begin));
  EXPECT_EQ(move.exit_status, 0) << refused << move.err;
}

// Its mass brakes so hard that it lifts the ball: that nothing is seen in the air must not look like a good margin.
TEST(Move, ThatLiftsTheBallIsSeenToHaveNoMargin) {
  const Folder folder;
  const Outcome move = folder.run("ballast move hop --mass 0 --to 0 --actuation stepper --out m");
  EXPECT_EQ(move.exit_status, 3) << move.err;
  EXPECT_EQ(folder.summary("m")["move"]["margin_min"], -1) << move.out;
}

TEST(Move, ToWhereTheMassesAreIsOverAtOnce) {
  const Folder folder;
  const Outcome move = folder.run("ballast move paper_ball --mass 0 --to 0 --out m");
  EXPECT_EQ(move.exit_status, 0) << move.err;
  const auto s = folder.summary("m");
  EXPECT_EQ(s["move"], nullptr);
  EXPECT_EQ(s["stop"], nullptr);
  EXPECT_EQ(s["motors"][0]["steps"], 0);
  EXPECT_LT(s["end"]["time"], 0.1);
  EXPECT_EQ(s["move_end"]["arrived"], true);
  EXPECT_EQ(move.out.find("still moving"), std::string::npos) << move.out;
  EXPECT_NE(move.out.find("nearly cancels"), std::string::npos) << "a ball let go at rest: " << move.out;
}

// Started at once, two motors' masses swing so that the ball slips, of which the closed forms know nothing.
TEST(Move, ThatTheMotorsSwingTookWhatWasPredictedIsSaid) {
  const Folder folder;
  const Outcome move = folder.run("ballast move desk_ball --all 0.5 --out m");
  EXPECT_EQ(move.exit_status, 3) << move.err;
  const auto planned = folder.summary("m")["move"];
  ASSERT_GT(planned["predicted_margin_min"].get<double>(), planned["margin_min"].get<double>() + 0.1);
  char words[160];
  std::snprintf(words, sizeof words, "  WARNING     the least margin was %.3g where %.3g was predicted: a prediction",
                planned["margin_min"].get<double>(), planned["predicted_margin_min"].get<double>());
  EXPECT_NE(move.out.find(words), std::string::npos) << move.out << words;
  EXPECT_NE(move.out.find("their motors' swing (how much: share)\n"), std::string::npos) << move.out;
}

TEST(Move, OneThatCannotBePredictedToItsEndIsRefusedUnlessForced) {
  const Folder folder;
  const Outcome refused = folder.run("ballast move paper_ball --all 0 --quiet --out m");
  EXPECT_EQ(refused.exit_status, 1);
  EXPECT_NE(refused.err.find("only the first "), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("it has a limited number of steps"), std::string::npos) << refused.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "m"));
  const Outcome forced = folder.run("ballast move paper_ball --all 0 --quiet --force --out m");
  const auto planned = folder.summary("m")["move"];
  ASSERT_LT(planned["predicted_for"], planned["duration"]);
  EXPECT_NE(forced.err.find("only the first "), std::string::npos) << forced.err;
}

TEST(Program, AWordThatIsNoCommandIsNamed) {
  const Folder folder;
  const Outcome outcome = folder.run("ballast rnu paper_ball");
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_NE(outcome.err.find("ballast: rnu: no such command; allowed: run, "), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("did you mean run?"), std::string::npos) << outcome.err;
  const Outcome early = folder.run("ballast --set gravity=1 paper_ball");
  EXPECT_EQ(early.exit_status, 1);
  EXPECT_NE(early.err.find("ballast: --set: options come after the command"), std::string::npos) << early.err;
}

TEST(Program, NamesTheBadOptionItsValueAndWhatIsAllowed) {
  const Folder folder;
  const std::pair<const char*, const char*> kCases[] = {
      {"ballast", "ballast: a command is missing; ballast --help lists them"},
      {"ballast nonsense --help", "ballast: nonsense: no such command; allowed: run, "},
      {"ballast run", "ballast: SCENARIO: is missing; ballast run --help shows the usage"},
      {"ballast run paper_ball x y --foo 3", "ballast: x: is one word too many; ballast run --help"},
      {"ballast run paper_ball --quite", "ballast: --quite: no such option; did you mean --quiet?"},
      {"ballast run paper_ball --speed", "ballast: --speed: its value is missing; allowed: a number"},
      {"ballast run paper_ball --speed 1 --speed 2", "ballast: --speed: is given more than once; allowed: once"},
      {"ballast run paper_ball --actuation steper",
       "ballast: --actuation: steper is unknown; allowed: prescribed, stepper, ideal; did you mean stepper?"},
      {"ballast move paper_ball --mass x --to 1", "ballast: --mass: x is not allowed; allowed: a whole number"},
      {"ballast soak --seeds 1 --jobs 5000",
       "ballast: --jobs: 5000 is out of range; allowed: a whole number from 1 to"},
  };
  for (const auto& [command, words] : kCases) {
    const Outcome outcome = folder.run(command);
    EXPECT_EQ(outcome.exit_status, 1) << command;
    EXPECT_NE(outcome.err.find(words), std::string::npos) << command << "\n" << outcome.err;
    EXPECT_EQ(outcome.out, "") << command;
  }
  EXPECT_EQ(folder.run("ballast run nonsense --help").exit_status, 0);
}

TEST(Run, WithoutALogKeepsEverythingElse) {
  const Folder folder;
  const Outcome run = folder.run("ballast run paper_ball --set duration=1 --no-log --out r");
  EXPECT_EQ(run.exit_status, 0) << run.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "r/run.lcmlog"));
  const auto s = folder.summary("r");
  EXPECT_EQ(s["log_bytes"], nullptr);
  EXPECT_EQ(s["ticks"], 1000);
  // A run that ends badly tells how to repeat it, and names no log.
  const Outcome slipped = folder.run("ballast run paper_ball --set surface.static_friction=0.17 --no-log --out s");
  EXPECT_EQ(slipped.exit_status, 3) << slipped.err;
  EXPECT_TRUE(std::filesystem::exists(folder / "s/blackbox/blackbox.json"));
  EXPECT_FALSE(std::filesystem::exists(folder / "s/blackbox/run.lcmlog"));
  const Outcome pictures = folder.run("ballast run paper_ball --no-log --pictures --out s");
  EXPECT_EQ(pictures.exit_status, 1);
  EXPECT_NE(pictures.err.find("--pictures: not with --no-log"), std::string::npos) << pictures.err;
}

TEST(Run, SaysWhereTheBallHasGone) {
  const Folder folder;
  const Outcome run = folder.run("ballast run paper_ball --set duration=2 --out r");
  EXPECT_EQ(run.exit_status, 0) << run.err;
  EXPECT_NE(run.out.find("\n  travel      rolled to ("), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("\n  coasts      "), std::string::npos) << run.out;
  const auto s = folder.summary("r");
  EXPECT_EQ(s["travel"]["position"], s["final"]["position"]);
  const double x = s["final"]["position"][0], y = s["final"]["position"][1];
  EXPECT_GE(s["travel"]["distance"].get<double>(), std::hypot(x, y));
  const double vx = s["final"]["velocity"][0], vy = s["final"]["velocity"][1];
  EXPECT_NEAR(s["travel"]["speed"].get<double>(), std::hypot(vx, vy), 1e-12);  // rolling: no vertical part but rounding
  // A step of DOP853 lasts a hundred ticks and more. Its chord falls short of the arc by at most (1 - sinc(a / 2)) of
  // it: 4 % for a turn a of 1 rad.
  ASSERT_EQ(folder.run("ballast run paper_ball --set duration=2 --actuation prescribed --out p").exit_status, 0);
  ASSERT_EQ(folder.run("ballast integrate paper_ball --set duration=2 --out i").exit_status, 0);
  const double run_m = folder.summary("p")["travel"]["distance"];
  EXPECT_NEAR(folder.summary("i")["travel"]["distance"].get<double>(), run_m, 0.04 * run_m);
}

// The printed command works without `ballast` on the PATH.
TEST(Program, NamesItselfAsItWasTyped) {
  const Folder folder;
  const Outcome outcome =
      folder.run("cd \"$(dirname \"$(command -v ballast)\")\" && ./ballast-plant paper_ball --lcm nonsense://");
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_NE(outcome.err.find("; ./ballast doctor --lcm nonsense:// examines it"), std::string::npos) << outcome.err;
}

// Success is that it was said; what went wrong otherwise stays what it was.
TEST(Program, SaysWhenItsOutputIsNotTaken) {
  const Folder folder;
  folder.write("ball.toml", kBall);
  ASSERT_EQ(folder.run("ballast run ball.toml --actuation stepper --quiet --out r").exit_status, 0);
  for (const char* command :
       {"ballast faults", "ballast check ball.toml", "ballast friction ball.toml", "ballast replay r",
        "ballast soak --seeds 0..0", "ballast run ball.toml", "ballast integrate ball.toml", "ballast --help",
        "ballast run --help", "ballast-plant --version"}) {
    SCOPED_TRACE(command);
    const Outcome full = folder.run(std::string(command) + " >/dev/full");
    EXPECT_EQ(full.exit_status, 2);
    EXPECT_NE(full.err.find("standard output could not be written"), std::string::npos) << full.err;
  }
  EXPECT_EQ(folder.run("ballast run ball.toml --quiet >/dev/full").exit_status, 0);
  // Closed, and not the first file that is opened instead.
  EXPECT_EQ(folder.run("ballast run ball.toml <&- >&-").exit_status, 2);
  EXPECT_EQ(folder.run("ballast run ball.toml --set surface.static_friction=0.01 >/dev/full").exit_status, 3);
}

TEST(Program, SaysItsVersion) {
  const Folder folder;
  for (const std::string name : {"ballast", "ballast-plant", "ballast-controller", "ballast-monitor"}) {
    const Outcome outcome = folder.run(name + " --version");
    EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
    EXPECT_TRUE(
        std::regex_match(outcome.out, std::regex(name + " " BALLAST_VERSION " \\(commit ([0-9a-f]{12}|unknown)\\)\n")))
        << outcome.out;
  }
}

TEST(Trip, SaysWhatWasSeenAndAllowedInItsOwnTerms) {
  const Folder folder;
  const auto trip_of = [&](const std::string& options) {
    const std::string out = folder.run("ballast run paper_ball --set duration=0.6 " + options).out;
    const auto begin = out.find("  trip  ");
    return begin == std::string::npos ? out : out.substr(begin, out.find('\n', begin) - begin);
  };
  EXPECT_NE(trip_of("--fault messages_dropped@0.5").find("the newest tick was 499 where 500 was due;"),
            std::string::npos);
  EXPECT_NE(trip_of("--fault sensor_nan@0.5").find("nonfinite at t = 0.5 s; the stop"), std::string::npos);
  EXPECT_NE(trip_of("--fault friction_falls@0.5:0.001").find("the ball slid at f_s/N = "), std::string::npos);
  EXPECT_NE(trip_of("--set envelope.friction_use=0.001").find(": f_s/N was "), std::string::npos);
  EXPECT_NE(trip_of("--fault sensor_bias@0.5:3,sensor=gyro").find(" N about N and f_s; allowed: <= "),
            std::string::npos);
  EXPECT_NE(trip_of("--fault messages_dropped@0.5:channel=BALLAST_CONTROLLER_STATUS")
                .find(": silent for 2 ticks; allowed: 1"),
            std::string::npos);
  EXPECT_NE(trip_of("--set envelope.min_normal_force=3.9999").find(" N; allowed: > 4 N"), std::string::npos);
}

TEST(Run, WarnsOfATaskThatNobodyHasPlanned) {
  const Folder folder;
  ASSERT_EQ(folder.run("ballast new first.toml --yes").exit_status, 0);
  const Outcome still = folder.run("ballast run first.toml --set duration=0.1 --quiet --no-log");
  EXPECT_EQ(still.exit_status, 0) << still.err;
  EXPECT_NE(still.err.find("task: has no motion yet, so no mass moves; `ballast plan first.toml` finds one"),
            std::string::npos)
      << still.err;
  EXPECT_NE(folder.run("ballast check first.toml").out.find("can be run, with 1 warning"), std::string::npos);
}

TEST(Plan, AFailedSearchTakesAnOlderPlanOutOfTheWay) {
  const Folder folder;
  ASSERT_EQ(folder.run("ballast new first --yes").exit_status, 0);
  folder.write("first_plan.toml", "[plan]  # of an earlier search");
  const Outcome failed = folder.run("ballast plan first.toml --time-limit 1e-9");
  EXPECT_EQ(failed.exit_status, 3) << failed.err;
  EXPECT_NE(failed.err.find("; the plan of an earlier search is now first_plan.old.toml"), std::string::npos)
      << failed.err;
  EXPECT_FALSE(std::filesystem::exists(folder / "first_plan.toml"));
  EXPECT_EQ(test::read_file(folder / "first_plan.old.toml"), "[plan]  # of an earlier search");
}

TEST(Plan, AShippedScenarioWithoutATaskIsToldSo) {
  const Folder folder;
  const Outcome refused = folder.run("ballast plan desk_ball");
  EXPECT_EQ(refused.exit_status, 1);
  EXPECT_NE(refused.err.find("desk_ball.toml: task: is missing"), std::string::npos) << refused.err;
  EXPECT_NE(refused.err.find("ballast new NAME` writes a robot with a [task]"), std::string::npos) << refused.err;
}

TEST(Run, AMissingLogIsExplainedByNoLog) {
  const Folder folder;
  ASSERT_EQ(folder.run("ballast run paper_ball --set duration=0.1 --quiet --no-log --out r").exit_status, 0);
  for (const char* command : {"report r", "replay r", "export r --csv t", "compare r r"}) {
    const Outcome outcome = folder.run(std::string("ballast ") + command);
    EXPECT_EQ(outcome.exit_status, 2) << command;
    EXPECT_NE(outcome.err.find("run.lcmlog: this run was made with --no-log"), std::string::npos) << outcome.err;
  }
}

TEST(Run, SaysWhatAStopWasPredictedToDo) {
  const Folder folder;
  ASSERT_EQ(
      folder.run("ballast run paper_ball --set envelope.friction_use=0.5 --set duration=8 --quiet --out r").exit_status,
      3);
  const auto s = folder.summary("r");
  EXPECT_EQ(s["move"], nullptr);
  // The stop begins with the tick after the trip's.
  EXPECT_NEAR(s["stop"]["start"].get<double>(), s["trip"]["time"].get<double>() + 0.001, 0.001);
  // Jerk 10 (its default here: the motion's own) from 0.15 rad/s: a triangle, twice sqrt(0.15 / 10); the peak would be
  // 1.22 without the limit of 1.02, a part of which makes it longer.
  EXPECT_NEAR(s["stop"]["duration"].get<double>(), 2 * std::sqrt(0.15 / 10), 0.01);
  // The motors' swinging adds 0.008 of f_s/N on the whole run, more where they brake: a tenth of the cone.
  EXPECT_NEAR(s["stop"]["margin_min"].get<double>(), s["stop"]["predicted_margin_min"].get<double>(), 0.1);
  // A run that ends as the stop begins has seen nothing of it.
  std::ostringstream until;
  until << 0.001 * s["trip"]["tick"].get<double>();
  const Outcome cut =
      folder.run("ballast run paper_ball --set envelope.friction_use=0.5 --out r --set duration=" + until.str());
  ASSERT_TRUE(folder.summary("r")["stop"].is_object()) << cut.out;
  EXPECT_EQ(folder.summary("r")["stop"]["margin_min"], nullptr);
  EXPECT_NE(cut.out.find("did not begin: the run ended at t = "), std::string::npos) << cut.out;
  EXPECT_EQ(cut.out.find("not predicted"), std::string::npos) << cut.out;
}

// There is no controller to ask why.
TEST(Run, APrescribedRunThatIsInterruptedCouldNotRun) {
  const Folder folder;
  const std::string run = "ballast run paper_ball --actuation prescribed --speed 1 --out r";
  const Outcome ended = folder.run(started("exec env --default-signal=INT " + run, "r/run.lcmlog") +
                                   "kill -INT $run; wait $run; echo \"status $?\"");
  EXPECT_NE(ended.out.find("status 2\n"), std::string::npos) << ended.out << ended.err;
  EXPECT_NE(ended.err.find("interrupted"), std::string::npos) << ended.err;
}

TEST(Check, SaysGoodOrEveryFault) {
  const Folder folder;
  folder.write("ball.toml", kBall);
  const Outcome good = folder.run("ballast check ball.toml --set ball.inertia=[0.6,0.6,0.6]");
  EXPECT_EQ(good.exit_status, 0);
  EXPECT_NE(good.out.find("good"), std::string::npos);
  const Outcome bad = folder.run("ballast check ball.toml --set gravity=-1 --set duration=0 --set mass.0.mass=nan");
  EXPECT_EQ(bad.exit_status, 1);
  for (const char* key : {"gravity", "duration", "mass.0.mass"}) EXPECT_NE(bad.err.find(key), std::string::npos) << key;
}

// Robots that cannot work are not called good, and are said to be what is wrong with them.
TEST(Check, NamesMotorsThatLackTorqueAndValuesNoRobotHas) {
  const Folder folder;
  // 0.1 N m s/rad at the shaft is 0.5 N m at desk_ball's greatest speed; the motor holds 0.4 N m.
  const Outcome weak = folder.run("ballast check desk_ball --set mass.0.motor.viscous_damping=0.1");
  EXPECT_EQ(weak.exit_status, 0) << weak.err;
  EXPECT_NE(weak.out.find("warning: mass.0.motor: lacks torque at t = "), std::string::npos) << weak.out;
  EXPECT_NE(weak.out.find("can be run, with 1 warning"), std::string::npos) << weak.out;
  EXPECT_EQ(weak.out.find(": good"), std::string::npos) << weak.out;
  const Outcome sound = folder.run("ballast check desk_ball");
  EXPECT_NE(sound.out.find("desk_ball: good"), std::string::npos) << sound.out;
  EXPECT_NE(sound.out.find("note: mass.0.motor, mass.1.motor: passes a resonance: rotor and mass swing at 52.1 Hz"),
            std::string::npos)
      << sound.out;
  const Outcome paper = folder.run("ballast check paper_ball");
  EXPECT_NE(paper.out.find("ball.inertia.2 = 1.1: is more than 1 kg m^2"), std::string::npos) << paper.out;
  const Outcome long_run = folder.run("ballast check desk_ball --set duration=1e5");
  EXPECT_NE(long_run.out.find("make a log of about "), std::string::npos) << long_run.out;
}

TEST(Check, NamesAFloorThatCannotHoldTheMotion) {
  const Folder folder;
  // desk_ball's motion alone needs 0.0139; its steppers add to that, which only a run shows.
  const Outcome slips = folder.run("ballast check desk_ball --set surface.static_friction=0.005");
  EXPECT_NE(slips.out.find("warning: surface.static_friction: the motion needs f_s / N = 0.0139 at t = "),
            std::string::npos)
      << slips.out;
  EXPECT_NE(slips.out.find("this floor gives 0.005: the ball slips"), std::string::npos) << slips.out;
  const Outcome trips =
      folder.run("ballast check desk_ball --set surface.static_friction=0.02 --set envelope.friction_use=0.5");
  EXPECT_NE(trips.out.find("0.5 of this floor's 0.02 is 0.01: the run trips"), std::string::npos) << trips.out;
  const Outcome pressed = folder.run("ballast check desk_ball --set envelope.min_normal_force=50");
  EXPECT_NE(pressed.out.find("warning: envelope.min_normal_force: the motion lowers N to "), std::string::npos)
      << pressed.out;
  const Outcome lifted = folder.run("ballast check hop");
  EXPECT_NE(lifted.out.find("warning: motion: the ball lifts off the floor at t = "), std::string::npos) << lifted.out;
  EXPECT_NE(folder.run("ballast check slide_to_roll").out.find("slide_to_roll: good"), std::string::npos)
      << "it begins sliding";
  // A slip that comes before the lift-off, which makes f_s / N infinite, is not lost in it.
  const Outcome both = folder.run("ballast check paper_detach --set surface.static_friction=0.05");
  EXPECT_NE(both.out.find("this floor gives 0.05: the ball slips"), std::string::npos) << both.out;
  EXPECT_NE(both.out.find("the ball lifts off the floor"), std::string::npos) << both.out;
}

TEST(Check, FloorAndEnvelopeOfABallWithoutMasses) {
  const Folder folder;
  const std::string ball =
      "name = 'b'\nduration = 2\ngravity = 1\n[ball]\nradius = 1\nmass = 1\n"
      "inertia = [0.4, 0.4, 0.4]\n[surface]\nstatic_friction = 0.5\n[run]\nactuation = 'prescribed'\n";
  folder.write("ball.toml", ball);
  // The monitor trips at N <= min_normal_force, and this ball presses with 1 N.
  const Outcome light = folder.run("ballast check ball.toml --set envelope.min_normal_force=1");
  EXPECT_NE(light.out.find("the ball lowers N to 1 N at t = 0 s"), std::string::npos) << light.out;
  EXPECT_EQ(folder.run("ballast run ball.toml --quiet --set envelope.min_normal_force=1").exit_status, 3);
  // No mass moves, so no motion is to blame.
  const Outcome pulled = folder.run("ballast check ball.toml --set external_force=[0,0,2]");
  EXPECT_NE(pulled.out.find("warning: the ball lifts off the floor at t = 0 s\n"), std::string::npos) << pulled.out;
  const Outcome pushed = folder.run("ballast check ball.toml --set external_force=[2,0,0]");
  EXPECT_NE(pushed.out.find("the ball needs f_s / N = 0.571 at t = 0 s"), std::string::npos) << pushed.out;
  EXPECT_EQ(pushed.out.find("slower motion"), std::string::npos) << pushed.out;
  // A resistance that presses the ball down by more than the force that causes it.
  const Outcome stuck = folder.run(
      "ballast check ball.toml --set surface.static_friction=inf --set surface.rolling_resistance=5 "
      "--set ball.center_of_mass=[0.5,0,0] --set initial.angular_velocity=[0,1,0]");
  EXPECT_NE(stuck.out.find("warning: the run ends at t = 0 s: "), std::string::npos) << stuck.out;
  const Outcome longer = folder.run("ballast check ball.toml --set duration=1500");
  EXPECT_NE(longer.out.find("note: the floor is checked up to t = 1000 s only"), std::string::npos) << longer.out;
}

TEST(Check, ReadsTheTaskOfARobotThatIsToBePlanned) {
  const Folder folder;
  EXPECT_EQ(folder.run("ballast new robot").exit_status, 0);
  EXPECT_EQ(folder.run("ballast check robot.toml").exit_status, 0);
  EXPECT_EQ(folder.run("sed -i 's/^goal = .*/goal = [0.1]/' robot.toml").exit_status, 0);
  // A run ignores [task], so that its errors are warnings.
  const Outcome bad = folder.run("ballast check robot.toml");
  EXPECT_EQ(bad.exit_status, 0) << bad.err;
  EXPECT_NE(bad.out.find("warning: robot.toml:"), std::string::npos) << bad.out;
  EXPECT_NE(bad.out.find("task.goal"), std::string::npos) << bad.out;
  const Outcome mended = folder.run("ballast check robot.toml --set task.goal=[0.1,0.0]");
  EXPECT_EQ(mended.out.find("task.goal"), std::string::npos) << mended.out;
  const Outcome set = folder.run("ballast check robot.toml --set task.goal=[0.1]");
  EXPECT_NE(set.out.find("with the command line's values"), std::string::npos) << set.out;
}

// The file's value is named where another one does not fit it; that it is the command line's doing has to be said.
TEST(Check, WhatTheCommandLineBrokeIsNotLeftToTheFile) {
  const Folder folder;
  folder.write("ball.toml", kBall);
  const Outcome both = folder.run("ballast check ball.toml --set duration=1e9 --set gravity=2 --actuation stepper");
  EXPECT_EQ(both.exit_status, 1);
  EXPECT_NE(both.err.find("makes 1e+12 control periods of the duration"), std::string::npos) << both.err;
  EXPECT_NE(both.err.find("ball.toml is valid without --set 'duration=1e9' --set 'gravity=2' --actuation stepper\n"),
            std::string::npos)
      << both.err;
  // Not where --set is named already, nor where the file is wrong by itself.
  EXPECT_EQ(folder.run("ballast check ball.toml --set gravity=-1").err.find("good without"), std::string::npos);
  folder.write("bad.toml", "frikction = 1\n" + kBall);
  EXPECT_EQ(folder.run("ballast check bad.toml --set gravity=2").err.find("good without"), std::string::npos);
}

TEST(Help, IsThereForEveryCommand) {
  const Folder folder;
  for (const char* line : {"ballast --help", "ballast run --help", "ballast check --help", "ballast friction --help",
                           "ballast-plant --help"}) {
    const Outcome help = folder.run(line);
    EXPECT_EQ(help.exit_status, 0) << line;
    EXPECT_GT(help.out.size(), 100u) << line;
  }
  EXPECT_EQ(folder.run("ballast").exit_status, 1);
}

}  // namespace
}  // namespace ballast
