// Three processes over LCM: the same messages as one process, and a defined end whoever dies.
#include <gtest/gtest.h>

#include <future>

#include "tests/sil/into_its_stop.h"
#include "tests/sil/shell.h"
#include "tools/sil/bus_operator.h"

namespace ballast {
namespace {

using test::bus_url;
using test::Folder;
using test::Outcome;
using test::read_file;

// The contract: in one process and in three, the same scenario gives the same messages. The logs are even the same
// bytes, since the plant records lap by lap, stamped with simulated time.
TEST(Processes, ThreeGiveTheSameLogAsOne) {
  const Folder folder;
  const std::string url = bus_url(0);
  folder.write("into_its_stop.toml", test::kIntoItsStop);
  for (const std::string scenario :
       {"into_its_stop.toml --set duration=1", "paper_ball --set duration=1", "desk_ball --set duration=0.7",
        "paper_ball --set envelope.friction_use=0.3",
        ("desk_ball --set duration=0.3 --set sensors.attitude=sensed --set sensors.preset=bmi088 "
         "--set sensors.latency=0.003"),
        ("desk_ball --set duration=0.3 --set run.hold=0.3 --set sensors.preset=bmi088 --set sensors.latency=0.003 "
         "--set sensors.position_fix.rate=50 --set sensors.encoder.resolution=0.001"),
        ("desk_ball --actuation ideal --set duration=0.3 --set run.hold=0.2 --set sensors.attitude=sensed "
         "--set sensors.preset=bmi088"),
        "paper_ball --actuation ideal --set envelope.friction_use=0.3",
        ("paper_ball --set duration=1 --set believed.ball.mass=1.3 --set believed.mass=[{mass=1.2}] "
         "--set believed.surface.slope.angle=0.05"),
        "paper_ball --actuation prescribed --set duration=1 --set surface.static_friction=0.1348"}) {
    SCOPED_TRACE(scenario);
    const Outcome one = folder.run("ballast run " + scenario + " --quiet --out one");
    const Outcome three =
        folder.run("ballast run " + scenario + " --quiet --out three --processes --lcm '" + url + "'");
    EXPECT_EQ(three.exit_status, one.exit_status) << three.err;
    EXPECT_TRUE(read_file(folder / "one/run.lcmlog") == read_file(folder / "three/run.lcmlog"));
    EXPECT_GT(read_file(folder / "one/run.lcmlog").size(), 10u);
    auto a = folder.summary("one"), b = folder.summary("three");
    for (auto* s : {&a, &b}) s->erase("wall_time"), s->erase("speed");
    EXPECT_EQ(a, b);
  }
}

// By hand, in any order, as the README says.
TEST(Processes, StartedByHandInAnyOrder) {
  const Folder folder;
  const std::string bus = " --lcm '" + bus_url(1) + "'";
  const Outcome run =
      folder.run("ballast-controller paper_ball --set duration=0.3" + bus + " & controller=$!; sleep 0.3; " +
                 "ballast-plant paper_ball --set duration=0.3 --out r" + bus + " & plant=$!; sleep 0.3; " +
                 "ballast-monitor paper_ball --set duration=0.3" + bus + " & monitor=$!; " +
                 "wait $plant; a=$?; wait $controller; b=$?; wait $monitor; echo $a $b $?");
  EXPECT_NE(run.out.find("0 0 0\n"), std::string::npos) << run.out << run.err;
  EXPECT_EQ(folder.summary("r")["end"]["reason"], "completed");
}

TEST(Processes, PeersWithAnotherScenarioAreRefused) {
  const Folder folder;
  const std::string bus = " --lcm '" + bus_url(2) + "' --start-timeout 5";
  const Outcome run =
      folder.run("ballast-monitor paper_ball" + bus + " & ballast-controller paper_ball --set ball.mass=1.1" + bus +
                 " & ballast-plant paper_ball --out r" + bus + "; a=$?; wait; echo $a");
  EXPECT_NE(run.out.find("2\n"), std::string::npos) << run.out;
  EXPECT_NE(run.err.find("another scenario"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("controller"), std::string::npos) << run.err;
}

// Two runs on one bus would answer each other: that is noticed, said, and never taken for a result.
TEST(Processes, TwoRunsOnOneBusAreRefused) {
  const Folder folder;
  const std::string run = "ballast run paper_ball --quiet --processes --lcm '" + bus_url(21) + "' --out ";
  for (const char* delay : {"0", "0.5"}) {
    const Outcome both = folder.run(run + "a & a=$!; sleep " + delay + "; " + run + "b; b=$?; wait $a; echo $? $b");
    EXPECT_NE(both.out.find("2 2\n"), std::string::npos) << both.out << both.err;
    EXPECT_NE(both.err.find("another "), std::string::npos) << both.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "a/summary.json"));
    EXPECT_FALSE(std::filesystem::exists(folder / "b/summary.json"));
  }
}

// Somebody at a terminal, and a run under way: in three processes and in one.
class Hand : public testing::TestWithParam<const char*> {};

TEST_P(Hand, ArmsMovesStartsAndStopsOnTheBus) {
  const Folder folder;
  const std::string run_how = GetParam();
  const std::string bus = " --lcm '" + bus_url(22 + static_cast<int>(run_how.empty())) + "'";
  // Each line says its exit status after it. The run is far longer than that takes, and ended when all is said.
  const Outcome said =
      folder.run("ballast run paper_ball " + run_how +
                 " --by-hand --speed 8 --set duration=600 --set run.control_period=0.004"
                 " --set surface.static_friction=inf"
                 " --out r" +
                 bus +
                 " 2>run.err & run=$!; i=0;"
                 " while [ $i -lt 100 ] && ! ballast operate status" +
                 bus +
                 " --peer-timeout 0.3 >/dev/null 2>&1;"
                 " do i=$((i + 1)); done;"
                 " say() { \"$@\"" +
                 bus +
                 "; echo \"$? <- $*\"; };"
                 " say ballast operate status;"
                 " say ballast move --mass 1 --to 2.1;"
                 " say ballast move --all 0.1 --mass 1 --to 2.2 --mass 2 --to 0.6 --speed-fraction 0.8 --quiet;"
                 " say ballast move paper_ball --mass 0 --to 1;"
                 " say ballast move --mass 3 --to 1;"
                 " say ballast move --mass 0 --to 1e300;"
                 " say ballast operate reset;"
                 " say ballast operate start;"
                 " say ballast move --mass 0 --to 0;"
                 " say ballast operate stop;"
                 " say ballast operate stop;"
                 " say ballast move --mass 0 --to 0;"
                 " say ballast operate arm;"
                 " say ballast move --mass 0 --to 0;"
                 " kill -INT $run; wait $run; echo $?");
  const auto expect_line = [&](const std::string& line) {
    EXPECT_NE(said.out.find(line), std::string::npos) << line << "\n" << said.out << said.err;
  };
  expect_line("armed, masses at rest at 0, 2.04, 0.704 in tick");
  expect_line(", the ball at (0, 0) m, ");
  expect_line("\n0 <- ballast operate status\n");
  expect_line("; least margin seen ");
  expect_line("armed, at 0, 2.1, 0.704;");
  expect_line("\n0 <- ballast move --mass 1 --to 2.1\n");
  expect_line("\n0 <- ballast move --all 0.1 --mass 1 --to 2.2 --mass 2 --to 0.6 --speed-fraction 0.8 --quiet\n");
  expect_line("\n1 <- ballast move paper_ball --mass 0 --to 1\n");
  expect_line("\n1 <- ballast move --mass 3 --to 1\n");
  expect_line("\n1 <- ballast move --mass 0 --to 1e300\n");
  expect_line("\n1 <- ballast operate reset\n");
  expect_line("running, ");
  expect_line("\n0 <- ballast operate start\n");
  expect_line("\n1 <- ballast move --mass 0 --to 0\n");  // while running
  expect_line("\nstopping, ");
  expect_line("disarmed, masses at rest at ");
  expect_line("\n0 <- ballast operate arm\n");
  expect_line("armed, at 0, ");
  expect_line("\n0 <- ballast move --mass 0 --to 0\n2\n");
  for (const char* reason : {"another scenario", "--mass 3: the robot on this bus has 3 masses; allowed: 0..2",
                             "mass 0: the target 1e+300", "it is armed; allowed now: start, move",
                             "it is running; allowed now: stop", "it is disarmed; allowed now: arm"}) {
    EXPECT_NE(said.err.find(reason), std::string::npos) << reason << "\n" << said.err;
  }
}

INSTANTIATE_TEST_SUITE_P(Processes, Hand, testing::Values("--processes", ""),
                         [](const auto& how) { return how.param[0] == 0 ? "InOneProcess" : "InThreeProcesses"; });

// A run by hand in the background, until somebody listens; then `said`, each with say(), and its end.
Outcome by_hand(const Folder& folder, const std::string& run, const std::string& bus, const std::string& said) {
  return folder.run("ballast run " + run + " --by-hand --out r" + bus +
                    " >run.out 2>run.err & run=$!; i=0;"
                    " while [ $i -lt 100 ] && ! ballast operate status" +
                    bus + " --peer-timeout 0.3 >/dev/null 2>&1; do i=$((i + 1)); done; say() { \"$@\"" + bus +
                    "; echo \"$? <- $*\"; }; " + said + " kill -INT $run 2>/dev/null; wait $run; echo $?");
}

// Whether the trip stops the masses or the ball has slipped, which ends the run in that very tick.
TEST(Processes, AMoveOnABusThatTripsSaysSoAndExitsWith3) {
  for (const std::string limit : {"envelope.friction_use=0.02", "surface.static_friction=0.02"}) {
    const Folder folder;
    const Outcome said =
        by_hand(folder, "paper_ball --speed 1 --set duration=60 --set run.control_period=0.004 --set " + limit,
                " --lcm '" + bus_url(26) + "'", "say ballast move --mass 1 --to 1;");
    EXPECT_NE(said.out.find("\n3 <- ballast move --mass 1 --to 1\n"), std::string::npos) << said.out << said.err;
    EXPECT_NE(said.err.find("the move was ended by a trip: mass 1 is at "), std::string::npos) << said.err;
    const bool floor = limit.find("surface") == 0;  // the monitor's own limit is not on the bus
    EXPECT_EQ(said.err.find("predicted to break the envelope: ") != std::string::npos, floor) << said.err;
  }
}

TEST(Processes, AMoveOnABusThatIsInterruptedSaysThatItGoesOn) {
  const Folder folder;
  const Outcome said = by_hand(folder, "paper_ball --speed 1 --set duration=60", " --lcm '" + bus_url(27) + "'",
                               "ballast move --mass 1 --to 2.5 --speed-fraction 0.01 --force --lcm '" + bus_url(27) +
                                   "' >move.out & move=$!; while ! grep -q moving move.out; do sleep 0.1; done; kill "
                                   "-INT $move; wait $move; echo \"interrupted: $?\";");
  EXPECT_NE(said.out.find("interrupted: 2\n"), std::string::npos) << said.out << said.err;
  EXPECT_NE(said.err.find("interrupted: the masses move on to their targets, mass 1 is at 2."), std::string::npos)
      << said.err;
  EXPECT_NE(said.err.find("; ballast operate stop --lcm 'udpm://"), std::string::npos) << said.err;
}

// A move is held to the same limits on a bus: it is taken back as soon as its length or its prediction is known.
TEST(Processes, AMoveOnABusThatIsTooLongOrNotPredictedIsTakenBack) {
  const Folder folder;
  const Outcome said = by_hand(folder, "paper_ball --speed 1 --set duration=60", " --lcm '" + bus_url(29) + "'",
                               "say ballast move --mass 1 --to 999; say ballast move --all 0; say ballast operate "
                               "status; say ballast move --mass 1 --to 2.5;");
  EXPECT_NE(said.out.find("1 <- ballast move --mass 1 --to 999\n"), std::string::npos) << said.out << said.err;
  EXPECT_NE(said.err.find("allowed: at most 600 s"), std::string::npos) << said.err;
  EXPECT_NE(said.out.find("1 <- ballast move --all 0\n"), std::string::npos) << said.out << said.err;
  EXPECT_NE(said.err.find("the controller can predict only the first "), std::string::npos) << said.err;
  EXPECT_NE(said.out.find("0 <- ballast operate status\n"), std::string::npos) << said.out << said.err;
  EXPECT_NE(said.out.find("armed, masses at rest at "), std::string::npos) << said.out << said.err;
  EXPECT_NE(said.out.find("0 <- ballast move --mass 1 --to 2.5\n"), std::string::npos) << said.out << said.err;
}

// The one that comes later is refused, and the other is what it is alone, byte for byte; of two that begin at once none
// is taken for a result.
TEST(Processes, ARunInOneProcessIsRefusedOnABusWhereAnotherIs) {
  const Folder folder;
  const std::string bus = " --lcm '" + bus_url(28) + "' --quiet --speed 1";
  const std::string run = "ballast run paper_ball --set duration=3 --out ";
  ASSERT_EQ(folder.run(run + "alone" + bus).exit_status, 0);
  const Outcome later = folder.run(run + "a" + bus + " & a=$!; sleep 1.5; " + run + "b" + bus + "; b=$?; " + run +
                                   "c --processes" + bus + "; c=$?; wait $a; echo $? $b $c");
  EXPECT_NE(later.out.find("0 2 2\n"), std::string::npos) << later.out << later.err;
  EXPECT_NE(later.err.find("another plant is on this bus (tick "), std::string::npos) << later.err;
  EXPECT_TRUE(read_file(folder / "a/run.lcmlog") == read_file(folder / "alone/run.lcmlog"));
  EXPECT_FALSE(std::filesystem::exists(folder / "b/run.lcmlog"));
  EXPECT_FALSE(std::filesystem::exists(folder / "c/run.lcmlog"));

  const Outcome together = folder.run(run + "d" + bus + " & d=$!; " + run + "e" + bus + "; e=$?; wait $d; echo $? $e");
  // Both are refused, or the one that the other had not heard yet when it gave way goes on: never both.
  const bool one = together.out == "0 2\n" || together.out == "2 0\n";
  EXPECT_TRUE(one || together.out == "2 2\n") << together.out << together.err;
  EXPECT_EQ(std::filesystem::exists(folder / "d/summary.json"), together.out == "0 2\n");
  EXPECT_EQ(std::filesystem::exists(folder / "e/summary.json"), together.out == "2 0\n");
}

TEST(Processes, AnOperatorWithoutAControllerIsToldSo) {
  const Folder folder;
  const std::string bus = " --peer-timeout 0.3 --lcm '" + bus_url(25) + "'";
  for (const std::string line : {"ballast operate arm", "ballast move --all 1"}) {
    const Outcome said = folder.run(line + bus);
    EXPECT_EQ(said.exit_status, 2);
    EXPECT_SAYS(said.err, "no controller is at work on this bus (listened on " + bus_url(25) + " for 0.3 s)");
  }
  const Outcome go = folder.run("ballast operate go --to 0.6,0" + bus);
  EXPECT_EQ(go.exit_status, 2);
  EXPECT_SAYS(go.err, "(listened on " + bus_url(25) + " for 0.3 s)");
  EXPECT_EQ(folder.run("ballast operate" + bus).exit_status, 1);
  EXPECT_EQ(folder.run("ballast operate dance" + bus).exit_status, 1);
  EXPECT_EQ(folder.run("ballast move --all 1 --out r" + bus).exit_status, 1);
  EXPECT_NE(folder.run("ballast move --all 1").err.find("SCENARIO"), std::string::npos);
  EXPECT_NE(folder.run("ballast run paper_ball --by-hand").err.find("--by-hand"), std::string::npos);
}

// The motion that a start by hand began 1.5 s before is under way. With steppers its fastest stretch leaves the masses
// no speed for a course, and the ball is halted first; so it is where the machine is too slow to find one in time, and
// where a mass was moved before, so that the motion did not begin as the scenario says.
TEST(Processes, AGoDuringAMotionStartedByHandArrives) {
  const Folder folder;
  const std::string bus = " --lcm '" + bus_url(29) + "'";
  struct Case {
    std::string actuation;
    bool moved = false;
  };
  for (const auto& [actuation, moved] : {Case{"ideal"}, Case{"stepper"}, Case{"ideal", true}}) {
    const std::string move = moved ? "ballast move --mass 1 --to 0.3" + bus + "; " : "";
    const Outcome said = folder.run(
        "ballast run desk_ball --by-hand --set control.governor=true --set duration=200 --set run.actuation=" +
        actuation + " --out " + actuation + bus +
        " 2>run.err & run=$!; i=0;"
        " while [ $i -lt 100 ] && ! ballast operate status" +
        bus + " >/dev/null 2>&1; do sleep 0.1; i=$((i+1)); done; " + move + "ballast operate start" + bus +
        "; sleep 1.5; ballast operate go --to 0.6,0.2 --wait" + bus + "; echo $?; kill -INT $run; wait");
    EXPECT_SAYS(said.out, " mm from there\n0\n");
  }
}

// A long way is planned up to a rest on it, and the remaining way while the ball rolls there. A halt on the way ends
// it.
TEST(Processes, AGoOnALongWaySetsOutBeforeAllOfItIsPlanned) {
  const Folder folder;
  const std::string bus = " --lcm '" + bus_url(30) + "'";
  const std::string go = "ballast operate go --to 1.2,0.5 --wait" + bus;
  const Outcome said = folder.run(
      "ballast run desk_ball --by-hand --set control.governor=true --set duration=200 --set run.actuation=ideal" + bus +
      " 2>run.err & run=$!; i=0;"
      " while [ $i -lt 100 ] && ! ballast operate status" +
      bus + " >/dev/null 2>&1; do sleep 0.1; i=$((i+1)); done; " + go + "; echo $?; ballast operate status" + bus +
      "; ballast operate go --to 0,0" + bus + " >back & go=$!; i=0;" +
      " while [ $i -lt 300 ] && ! grep -q 'on its way to (0, 0) m' back; do sleep 0.1; i=$((i+1)); done;" +
      " ballast operate halt" + bus + " >/dev/null; wait $go; echo $?; cat back; i=0;" +
      " while [ $i -lt 100 ] && ! ballast operate status" + bus + " | grep -q disarmed; do ballast operate stop" + bus +
      " >/dev/null 2>&1; sleep 0.1; i=$((i+1)); done;" + " ballast operate go --to 1,0" + bus +
      " 2>&1; kill -INT $run; wait");
  EXPECT_SAYS(said.out, " on, on its way to (1.2, 0.5) m, and needs ");
  EXPECT_SAYS(said.out, "goes to (1.2, 0.5) m in ");
  EXPECT_SAYS(said.out, " mm from there\n0\nrunning, ");
  EXPECT_SAYS(said.out, ", its course ends at (1.2, 0.5) m\n3\n");
  EXPECT_SAYS(said.out, "the course ended before the ball was there, at (");
  EXPECT_SAYS(said.out, "the controller refuses the course: it is disarmed; allowed now: arm");
}

// Where the ball rests there is nothing to go for. Without a governor a running motion only stops.
TEST(Processes, AGoToWhereTheBallRestsSendsNothing) {
  const Folder folder;
  const std::string bus = " --lcm '" + bus_url(31) + "'";
  const auto by_hand = [&](const std::string& set, const std::string& commands) {
    return folder.run("ballast run desk_ball --by-hand --set duration=60" + set + " --no-log" + bus +
                      " 2>run.err & run=$!; i=0;"
                      " while [ $i -lt 100 ] && ! ballast operate status" +
                      bus + " >/dev/null 2>&1; do sleep 0.1; i=$((i+1)); done; " + commands + "; kill -INT $run; wait");
  };
  const Outcome there = by_hand(" --set control.governor=true", "ballast operate go --to 0.0004,0 --wait" + bus +
                                                                    "; echo $?; ballast operate status" + bus);
  EXPECT_SAYS(there.out, "the ball rests there already, at (0, 0) m, 0.4 mm from (0.0004, 0) m\n0\narmed, ");
  const Outcome ungoverned =
      by_hand("", "ballast operate start" + bus + "; ballast operate halt" + bus + " 2>&1; echo $?");
  EXPECT_SAYS(ungoverned.out, "allowed now: stop; go and halt need a governor, which this run does not have\n1\n");
}

// A planner that died in its hand-over has left a course that never comes to an end.
TEST(Processes, AGoTakesThePlaceOfACourseWhosePlannerHasDied) {
  const Folder folder;
  const std::string url = bus_url(23), bus = " --lcm '" + url + "'";
  auto gone = std::async(std::launch::async, [&] {
    return folder.run("ballast run desk_ball --by-hand --set control.governor=true --set duration=200 --no-log" + bus +
                      " 2>run.err & run=$!; i=0; while [ $i -lt 300 ] && ! [ -e sent ]; do sleep 0.1; i=$((i+1)); done;"
                      " ballast operate go --to 0.1,0" +
                      bus + "; echo $?; kill -INT $run; wait");
  });
  hal::Bus own(url);
  sil::BusOperator planner(own, hal::Seconds(1));
  hal::Status met = planner.connect();
  for (int tried = 0; met != hal::Status::kOk && tried < 30; ++tried) met = planner.connect();
  EXPECT_EQ(met, hal::Status::kOk) << planner.trouble();
  if (met == hal::Status::kOk) {
    firmware::CoursePart part;
    part.course = 5;
    part.total = 100;
    part.count = 1;
    EXPECT_EQ(planner.tell(part), hal::Status::kOk) << planner.trouble();
    EXPECT_EQ(planner.status().course_coming, 5);
  }
  folder.write("sent", "");
  const Outcome said = gone.get();
  EXPECT_SAYS(said.out, "nothing more of that course is heard: takes its place\n");
  EXPECT_SAYS(said.out, "goes to (0.1, 0) m in ");
  EXPECT_SAYS(said.out, "\n0\n");
}

// A place is two numbers, and nothing else.
TEST(Processes, APlaceToGoToIsReadStrictly) {
  const Folder folder;
  for (const std::string place : {"0.6", "0.6,", ",0", "0.6;0", "0.6,0,1", "0.6, 0", "nan,0", "0,1e5", "0x1,0"}) {
    const Outcome to = folder.run("ballast operate go --to '" + place + "'");
    EXPECT_EQ(to.exit_status, 1);
    EXPECT_SAYS(to.err, "--to = \"" + place + "\": is no place; allowed: X,Y in m");
    const Outcome via = folder.run("ballast operate go --to -0.6,.5 --via 1,2 --via '" + place + "'");
    EXPECT_EQ(via.exit_status, 1);
    EXPECT_SAYS(via.err, "--via = \"" + place + "\": is no place; allowed: X,Y in m");
  }
  EXPECT_SAYS(folder.run("ballast operate go").err, "--to X,Y is missing");
}

// SIGKILL once the log shows that the run is under way (waited for at most 30 s), paced so that it would take 60 s.
// Everybody left ends with status 2 and names the dead peer; the log is kept.
class DeadPeer : public testing::TestWithParam<const char*> {};

TEST_P(DeadPeer, IsNoticedAndNamedByTheOthers) {
  const Folder folder;
  const std::string dead = GetParam();
  const std::string bus = " --lcm '" + bus_url(3 + static_cast<int>(dead.size())) + "' --peer-timeout 1";
  const Outcome run = folder.run(
      "for p in monitor controller plant; do o=''; [ $p = plant ] && o='--speed 0.33 --out r';"
      " ballast-$p paper_ball" +
      bus +
      " $o & eval $p=$!; done; i=0;"
      " while [ $i -lt 300 ] && [ \"$(stat -c %s r/run.lcmlog 2>/dev/null || echo 0)\" -le 20000 ];"
      " do sleep 0.1; i=$((i + 1)); done; kill -9 $" +
      dead + "; for p in plant controller monitor; do eval wait \\$$p; echo $p $?; done");
  for (const std::string peer : {"plant", "controller", "monitor"}) {
    if (peer == dead) continue;
    EXPECT_NE(run.out.find(peer + " 2\n"), std::string::npos) << run.out << run.err;
    // Each line is "program: what happened".
    const auto line = run.err.find("ballast-" + peer + ": ");
    ASSERT_NE(line, std::string::npos) << run.err;
    EXPECT_NE(run.err.substr(line + 9 + peer.size(), run.err.find('\n', line) - line - 9 - peer.size()).find(dead),
              std::string::npos)
        << run.err;
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "r/summary.json"));
  EXPECT_GT(std::filesystem::file_size(folder / "r/run.lcmlog"), 10000u);
}

INSTANTIATE_TEST_SUITE_P(Processes, DeadPeer, testing::Values("plant", "controller", "monitor"),
                         [](const auto& peer) { return std::string(peer.param); });

// --- faults ---

// Faults of messages and clock act the same in three processes as in one: the same log, to the byte, the same end, and
// a log that replays.
class MessageFaultInProcesses : public testing::TestWithParam<const char*> {};

TEST_P(MessageFaultInProcesses, GivesTheSameLogAsInOne) {
  const Folder folder;
  const std::string url = bus_url(11);
  // In the motion, which is over at 0.2 s; the stop takes 0.2 s. On a floor that holds whatever the motors do.
  const std::string run =
      "ballast run paper_ball --quiet --set duration=0.5 --set surface.static_friction=inf --set "
      "surface.kinetic_friction=inf --fault " +
      std::string(GetParam());
  const Outcome one = folder.run(run + " --out one");
  const Outcome three = folder.run(run + " --out three --processes --lcm '" + url + "'");
  EXPECT_EQ(three.exit_status, one.exit_status) << three.err;
  EXPECT_TRUE(read_file(folder / "one/run.lcmlog") == read_file(folder / "three/run.lcmlog"));
  const Outcome replay = folder.run("ballast replay three --verify");
  EXPECT_EQ(replay.exit_status, 0) << replay.out << replay.err;
  if (one.exit_status == 2) {
    EXPECT_FALSE(std::filesystem::exists(folder / "three/summary.json"));
    return;
  }
  auto a = folder.summary("one"), b = folder.summary("three");
  for (auto* s : {&a, &b}) s->erase("wall_time"), s->erase("speed"), s->erase("refused_messages");
  EXPECT_EQ(a, b);
}

INSTANTIATE_TEST_SUITE_P(
    Processes, MessageFaultInProcesses,
    testing::Values("messages_dropped@0.1", "messages_dropped@0.1:0.02,channel=BALLAST_TRIP",
                    "messages_dropped@0.1:channel=BALLAST_CONTACT,duration=0.001",
                    "messages_dropped@0.1:channel=BALLAST_PLANT_STATE",
                    "messages_dropped@0.1:channel=BALLAST_CONTROLLER_STATUS",
                    "messages_dropped@0.1:channel=BALLAST_STEP_COMMAND", "messages_dropped@0.1:peer=controller",
                    "messages_delayed@0.1:1,peer=controller", "messages_delayed@0.1:1,channel=BALLAST_CONTACT",
                    "messages_delayed@0.1:2,channel=BALLAST_TRIP", "messages_doubled@0.1",
                    "messages_doubled@0.1:channel=BALLAST_STEP_COMMAND", "messages_reordered@0.1:0.1",
                    "messages_reordered@0.1:peer=controller", "messages_corrupted@0.1:8",
                    "messages_corrupted@0.1:1,channel=BALLAST_TRIP", "messages_truncated@0.1:1,peer=monitor",
                    "messages_truncated@0.1:channel=BALLAST_TRIP", "clock_jump@0.1:100", "clock_jump@0.1:-1"),
    [](const auto& fault) { return "Case" + std::to_string(fault.index); });

// Faults of peers are real there: `ballast run` sends them signals.
struct FaultedRun {
  explicit FaultedRun(const std::string& fault, const std::string& more = "")
      : run(folder.run("ballast run paper_ball --set duration=0.3 --out r --processes --lcm '" + bus_url(12) +
                       "' --fault " + fault + " " + more)) {}
  Folder folder;
  Outcome run;

  // The log is whole up to the tick before the fault's.
  void expect_given_up(const std::string& peer, const std::string& last_tick) const {
    EXPECT_EQ(run.exit_status, 2) << run.out << run.err;
    const auto own = run.err.find("ballast: ");  // the others have a line each, too
    ASSERT_NE(own, std::string::npos) << run.err;
    EXPECT_NE(run.err.substr(own, run.err.find('\n', own) - own).find(peer), std::string::npos) << run.err;
    EXPECT_FALSE(std::filesystem::exists(folder / "r/summary.json"));
    expect_replays(last_tick);
    const std::string before = "; again: ";  // the command that is printed does what it says
    const auto again = run.err.find(before);
    ASSERT_NE(again, std::string::npos) << run.err;
    const auto command = again + before.size();
    const Outcome repeated = folder.run(run.err.substr(command, run.err.find('\n', command) - command));
    EXPECT_EQ(repeated.exit_status, 2) << repeated.out << repeated.err;
    EXPECT_TRUE(test::read_file(folder / "r/run.lcmlog") == test::read_file(folder / "r/blackbox/again/run.lcmlog"));
    const std::string told = "only what the controller was told: ";
    const auto replay = run.err.find(told);
    ASSERT_NE(replay, std::string::npos) << run.err;
    const auto replay_command = replay + told.size();
    EXPECT_EQ(
        folder.run(run.err.substr(replay_command, run.err.find('\n', replay_command) - replay_command) + " --verify")
            .exit_status,
        0);
    EXPECT_EQ(run.err.find("interrupted"), std::string::npos) << "nobody has: " << run.err;
  }
  // Nobody has noticed anything, but for the clock on the wall.
  void expect_unharmed() const {
    EXPECT_EQ(run.exit_status, 0) << run.out << run.err;
    ASSERT_EQ(folder.run("ballast run paper_ball --set duration=0.3 --quiet --out healthy").exit_status, 0);
    EXPECT_EQ(folder.summary("r")["final"], folder.summary("healthy")["final"]);
    expect_replays("300");
  }
  void expect_replays(const std::string& last_tick) const {
    const Outcome replay = folder.run("ballast replay r --verify");
    EXPECT_EQ(replay.exit_status, 0) << replay.out << replay.err;
    EXPECT_NE(replay.out.find("ticks -2 to " + last_tick + " of "), std::string::npos) << replay.out;
  }
};

TEST(PeerFaultInProcesses, WhoIsKilledIsNamedAndEndsTheRun) {
  FaultedRun("peer_killed@0.1").expect_given_up("ballast-controller ended: Killed", "99");
  FaultedRun("peer_killed@0.1:peer=monitor").expect_given_up("ballast-monitor ended: Killed", "99");
}

TEST(PeerFaultInProcesses, WhoIsFrozenForTooLongIsNamedAndEndsTheRun) {
  const std::string timeout = "--peer-timeout 1";
  FaultedRun("peer_frozen@0.1", timeout).expect_given_up("controller", "99");
  FaultedRun("peer_frozen@0.1:peer=monitor", timeout).expect_given_up("monitor", "99");
}

TEST(PeerFaultInProcesses, WhoIsFrozenForLessIsWaitedFor) {
  FaultedRun("peer_frozen@0.1:duration=0.3").expect_unharmed();
  FaultedRun("peer_frozen@0.1:peer=monitor,duration=0.3").expect_unharmed();
}

// 5 ms late in each of 50 ticks; the run would be over in less.
TEST(PeerFaultInProcesses, WhoIsSlowIsWaitedFor) {
  for (const char* peer : {"controller", "monitor"}) {
    const FaultedRun slow("peer_too_slow@0.1:5,duration=0.05,peer=" + std::string(peer));
    slow.expect_unharmed();
    EXPECT_GE(slow.folder.summary("r")["wall_time"].get<double>(), 0.25);
  }
  FaultedRun("peer_too_slow@0.1").expect_unharmed();                // to the last tick
  FaultedRun("peer_frozen@0.2995:duration=0.1").expect_unharmed();  // in it
  // The longer of two sleeps counts.
  FaultedRun("peer_frozen@0.1 --fault peer_too_slow@0.1:1", "--peer-timeout 0.5").expect_given_up("controller", "99");
  FaultedRun("peer_too_slow@0.1:1000", "--peer-timeout 0.5").expect_given_up("controller", "99");
}

TEST(PeerFaultInProcesses, AControllerStartedAnewIsFoundOut) {
  // It answers the tick, and so the tick is in the log: it counts no commands.
  FaultedRun("peer_restarted@0.1").expect_given_up("the controller was started again: in tick 100", "100");
}

TEST(PeerFaultInProcesses, AMonitorStartedAnewGoesOn) {
  FaultedRun("peer_restarted@0.1:peer=monitor").expect_unharmed();
}

TEST(PeerFaultInProcesses, WhatCannotBeHadIsRefused) {
  const Folder folder;
  const Outcome overrun = folder.run("ballast run paper_ball --processes --fault controller_overrun@0.1");
  EXPECT_EQ(overrun.exit_status, 1);
  EXPECT_NE(overrun.err.find("controller_overrun at 0.1 s"), std::string::npos) << overrun.err;
  const Outcome by_hand = folder.run("ballast-plant paper_ball --fault peer_killed@0.1");
  EXPECT_EQ(by_hand.exit_status, 1);
  EXPECT_NE(by_hand.err.find("cannot be injected in processes started by hand"), std::string::npos) << by_hand.err;
}

// The programs `ballast run --processes` starts do not outlive it, and their end is noticed at once.
TEST(Processes, AChildThatDiesEndsTheRun) {
  const Folder folder;
  const Outcome run = folder.run("ballast run paper_ball --processes --speed 0.33 --out r --lcm '" + bus_url(20) +
                                 "' & run=$!; sleep 1; pkill -9 -P $run ballast-control; wait $run; echo $?");
  EXPECT_NE(run.out.find("2\n"), std::string::npos) << run.out << run.err;
  EXPECT_NE(run.err.find("ballast-controller ended"), std::string::npos) << run.err;
}

}  // namespace
}  // namespace ballast
