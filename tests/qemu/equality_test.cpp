// The Cortex-M7's firmware and the host's: the same bits in every message of a run.
#include <gtest/gtest.h>

#include "tests/sil/shell.h"

namespace ballast {
namespace {

using test::Folder;
using test::Outcome;
using test::read_file;

void expect_equal(const std::string& arguments, int exit_status) {
  SCOPED_TRACE(arguments);
  const Folder folder;
  const Outcome host = folder.run("ballast run " + arguments + " --quiet --out host");
  const Outcome qemu = folder.run("ballast run " + arguments + " --quiet --firmware qemu --out qemu");
  EXPECT_EQ(host.exit_status, exit_status) << host.err;
  EXPECT_EQ(qemu.exit_status, exit_status) << qemu.err;
  EXPECT_TRUE(read_file(folder / "host/run.lcmlog") == read_file(folder / "qemu/run.lcmlog"))
      << folder.run("ballast compare host qemu").out;
  EXPECT_GT(read_file(folder / "host/run.lcmlog").size(), 100000u);
  auto a = folder.summary("host"), b = folder.summary("qemu");
  for (auto* s : {&a, &b}) s->erase("wall_time"), s->erase("speed");
  EXPECT_EQ(a, b);
}

TEST(TargetEquality, ThePapersWholeRun) { expect_equal("paper_ball", 0); }
TEST(TargetEquality, TheWholeRunOfDeskBall) { expect_equal("desk_ball", 0); }
// A trip, its stop and the prediction along it.
TEST(TargetEquality, AStop) { expect_equal("paper_ball --set envelope.friction_use=0.3", 3); }
TEST(TargetEquality, ASpline) { expect_equal("seam_ball --set duration=2", 0); }
TEST(TargetEquality, ALineWithEndsAndAStopOnIt) { expect_equal("hop --actuation stepper", 3); }
TEST(TargetEquality, IdealMassesAfterAHold) {
  expect_equal("desk_ball --actuation ideal --set run.hold=0.3 --set duration=1", 0);
}

// The filter, the measured contact force and encoders; once with a stop, whose prediction starts from the estimate.
TEST(TargetEquality, AnEstimatedAttitude) {
  const std::string sensors =
      "desk_ball --set sensors.preset=bmi088 --set sensors.latency=0.003 --set sensors.position_fix.rate=20 "
      "--set run.hold=0.5";
  expect_equal(sensors + " --set sensors.encoder.resolution=0.001 --set duration=1", 0);
  expect_equal(sensors + " --set duration=1.5 --set envelope.friction_use=0.03", 3);
}

// Feedback along the reference, whose table travels over the link: not the robot that the controller believes, and
// pushed. With ideal masses on an unknown slope; with steppers and an estimate that places from outside correct.
TEST(TargetEquality, ATrackedPushedRun) {
  const std::string run =
      "desk_ball --set control.tracking=true --set believed.ball.mass=0.82 "
      "--fault push@0.5:2,duration=0.1,direction=[0.6,0.8,0]";
  expect_equal(run + " --actuation ideal --set surface.slope.angle=0.01 --set duration=3", 0);
  const std::string sensors = " --set sensors.preset=bmi088_calibrated --set sensors.position_fix.rate=20";
  expect_equal(run + sensors + " --set run.hold=0.5 --set duration=1.5", 0);
}

// Bent commands, certificates and backups; once with feedback, an estimate and a push besides.
TEST(TargetEquality, AGovernedRun) {
  const std::string governed = " --set control.governor=true --set control.friction_use=1 ";
  const std::string floor = "--set surface.static_friction=0.16 --set surface.kinetic_friction=0.1 ";
  expect_equal("paper_ball" + governed + floor + "--actuation ideal --set duration=12", 0);
  expect_equal("paper_ball" + governed + floor + "--set duration=4", 0);
  expect_equal("desk_ball" + governed +
                   "--set control.tracking=true --set believed.ball.mass=0.82 --set sensors.preset=bmi088_calibrated "
                   "--set sensors.position_fix.rate=20 --set run.hold=0.5 --set duration=1.5 "
                   "--fault push@0.5:2,duration=0.1,direction=[0.6,0.8,0]",
               0);
}

// Errors of the belief declared: astray from step to step of every rollout.
TEST(TargetEquality, AGovernedRunOfAnUncertainRobot) {
  const std::string uncertain = " --set control.governor=true --set control.belief_error.mass=0.02 ";
  expect_equal("paper_ball" + uncertain + "--actuation ideal --set believed.ball.mass=1.01 --set duration=8", 0);
  expect_equal("desk_ball" + uncertain +
                   "--set control.belief_error.center_of_mass=0.0007 --set control.tracking=true "
                   "--set believed.ball.mass=0.81 --set duration=1.5 --fault push@0.5:2,duration=0.1",
               0);
}

// No pulse for longer than the step timer counts, 172 s.
TEST(TargetEquality, ALongRest) { expect_equal("desk_ball --set duration=180 --set run.control_period=0.01", 0); }

// A log of the host's, given to the microcontroller's.
TEST(TargetEquality, AReplay) {
  const Folder folder;
  folder.run("ballast run paper_ball --set envelope.friction_use=0.3 --quiet --out host");
  const Outcome replay = folder.run("ballast replay host --verify --firmware qemu");
  EXPECT_EQ(replay.exit_status, 0) << replay.out << replay.err;
  EXPECT_NE(replay.out.find("equal"), std::string::npos) << replay.out;
}

}  // namespace
}  // namespace ballast
