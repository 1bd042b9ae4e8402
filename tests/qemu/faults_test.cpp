// Every fault on the target or on the way to it ends the run, with its own reason and exit status, and leaves
// no QEMU behind. The faults are built into the firmware of sabotage_main.cpp.
#include <gtest/gtest.h>
#include <signal.h>

#include <fstream>

#include "sim/scenario/reader.h"
#include "tests/sil/shell.h"
#include "tools/program/params.h"
#include "tools/program/program.h"
#include "tools/qemu/qemu_firmware.h"
#include "tools/recording/record_run.h"
#include "tools/sil/local_peers.h"

namespace ballast {
namespace {

sim::Scenario paper_ball(double duration_s) {
  const auto read =
      sim::read_scenario(BALLAST_SCENARIO_DIR "/paper_ball.toml", {"duration=" + std::to_string(duration_s)});
  EXPECT_TRUE(read.ok());
  return read.scenario;
}

struct End {
  int exit_status;
  std::string err;
};

class Target : public testing::Test {
 protected:
  Target() : scenario_(paper_ball(0.2)) { EXPECT_EQ(program::to_controller_params(scenario_, *params_), std::nullopt); }

  End run(const std::string& elf, const std::string& arguments, double peer_timeout_s = 20) {
    sil::QemuFirmwareOptions options;
    options.qemu.elf = std::string(BALLAST_BUILD_DIR) + "/" + board_ + "/bin/" + elf;
    options.qemu.board = board_;
    options.qemu.arguments = arguments;
    options.peer_timeout = sil::Seconds(peer_timeout_s);
    sil::OutputDir output((folder_ / "run").string());
    testing::internal::CaptureStderr();
    int exit_status = 0;
    {
      auto owned = std::make_unique<sil::QemuFirmware>(scenario_, *params_, options);
      const sil::QemuFirmware& firmware = *owned;
      sil::LocalPeers peers(program::to_monitor_limits(scenario_), std::move(owned));
      exit_status = sil::record_run("ballast", scenario_, peers, output, {.quiet = true});
      pid_ = firmware.pid();
    }
    EXPECT_TRUE(pid_ == 0 || kill(pid_, 0) != 0) << "QEMU is still there";
    return {exit_status, testing::internal::GetCapturedStderr()};
  }
  void expect_end(const std::string& sabotage, int exit_status, const std::string& text, int tick = 100) {
    const End end = run("sabotage.elf", sabotage + "@" + std::to_string(tick));
    EXPECT_EQ(end.exit_status, exit_status) << sabotage << ": " << end.err;
    EXPECT_NE(end.err.find(text), std::string::npos) << end.err;
    EXPECT_EQ(std::filesystem::exists(folder_ / "run/summary.json"), exit_status == program::kExitCompleted);
  }

  test::Folder folder_;
  std::string board_ = "mps2_an500";
  sim::Scenario scenario_;
  std::unique_ptr<firmware::ControllerParams> params_ = std::make_unique<firmware::ControllerParams>();
  pid_t pid_ = 0;
};

TEST_F(Target, WithoutAFaultTheRunCompletes) {
  const End end = run("sabotage.elf", "nothing@100");
  EXPECT_EQ(end.exit_status, program::kExitCompleted) << end.err;
  EXPECT_EQ(folder_.summary("run")["end"]["reason"], "completed");
}

TEST_F(Target, FaultsSayWhatAndWhere) {
  expect_end("undefined", program::kExitFirmwareFault, "faulted at tick 100: undefined instruction; pc 0x");
  expect_end("unmapped", program::kExitFirmwareFault, "faulted at tick 100: bus error on data");
  expect_end("divide", program::kExitFirmwareFault, "faulted at tick 100: division by zero");
  expect_end("overflow", program::kExitFirmwareFault, "faulted at tick 100: its stack ran into the guard");
}

TEST_F(Target, TheWatchdogEndsAFirmwareThatHangs) {
  expect_end("hang", program::kExitFirmwareHung, "hung at tick 100: its watchdog ended it; pc 0x");
  expect_end("masked", program::kExitFirmwareHung, "hung at tick 100");  // with interrupts off
}

TEST_F(Target, ALateTickEndsTheRun) {
  expect_end("late", program::kExitLate, "tick 100 is late: the next one began before it was served");
  expect_end("late", program::kExitLate, "instructions; run.control_period = 0.001 s has 250000)");
  expect_end("late-after", program::kExitLate, "tick 100 is late: the next one began before its end");
}

// After which no answer comes that could say so: 0.2 s end with tick 200.
TEST_F(Target, AsTheLastDoes) {
  expect_end("late-after", program::kExitLate, "tick 200 is late: the next one began before its end", 200);
  expect_end("late-after", program::kExitCompleted, "", 201);  // there is no such tick
}

// 5 us are 1,250 instructions: no tick is served in four periods, so that is no firmware that hangs. What is told to
// show it again has it in QEMU, too.
TEST_F(Target, APeriodTooShortIsToldFromAFirmwareThatHangs) {
  const test::Folder folder;
  const std::string elf = BALLAST_BUILD_DIR "/mps2_an500/bin/ballast-mps2_an500.elf";
  const test::Outcome run = folder.run(
      "ballast run paper_ball --set run.control_period=5e-6 --set duration=0.001 --firmware qemu --firmware-elf " +
      elf + " --out r");
  EXPECT_EQ(run.exit_status, program::kExitLate) << run.err;
  EXPECT_NE(
      run.err.find("run.control_period = 5e-06 s is too short for this target; its watchdog ended a tick that did "
                   "not come back within 4 periods, 5000 instructions"),
      std::string::npos)
      << run.err;
  EXPECT_NE(run.err.find("/r/run.lcmlog --firmware qemu --firmware-elf " + elf), std::string::npos) << run.err;
}

TEST_F(Target, WhatIsNoFirmwareIsNotStarted) {
  const test::Folder folder;
  std::ofstream(folder / "text.elf") << "\177ELF, it says";
  for (const std::string& file :
       {std::string("/etc/passwd"), std::string("/proc/self/exe"), (folder / "text.elf").string()}) {
    const test::Outcome run = folder.run("ballast run paper_ball --firmware qemu --firmware-elf " + file + " --out r");
    EXPECT_EQ(run.exit_status, program::kExitCouldNotRun);
    EXPECT_NE(run.err.find(file + ": is no program for mps2_an500; allowed: an ELF file for ARM, as tools/firmware "
                                  "builds it"),
              std::string::npos)
        << run.err;
  }
}

TEST_F(Target, AnAnswerThatIsNotThisRunsEndsTheRun) {
  expect_end("steps-tick", program::kExitCouldNotRun,
             "the firmware's answer at tick 100 is not of this run: steps.tick 100, expected 101");
  expect_end("steps-motors", program::kExitCouldNotRun,
             "the firmware's answer at tick 100 is not of this run: steps.motor_count 0, expected 3");
  expect_end("status-motors", program::kExitCouldNotRun,
             "the firmware's answer at tick 100 is not of this run: status.motor_count 2, expected 3");
}

// The stack pointer is the one before the processor pushed its frame, whatever the frame had in it: sabotage_main.cpp
// leaves it in r0.
TEST_F(Target, FaultReportsKnowTheStackPointer) {
  for (const char* board : {"mps2_an500", "mps2_an386"}) {
    board_ = board;
    for (const char* sabotage : {"sp-fpu", "sp-fpu-odd", "sp-plain", "sp-plain-odd"}) {
      const End end = run("sabotage.elf", std::string(sabotage) + "@100");
      EXPECT_EQ(end.exit_status, program::kExitFirmwareFault) << end.err;
      const auto value_of = [&](const std::string& name) {
        const auto at = end.err.find(", " + name + " 0x");
        return at == std::string::npos ? name : end.err.substr(at + name.size() + 3, 10);
      };
      EXPECT_EQ(value_of("sp"), value_of("r0")) << board << ' ' << sabotage << ": " << end.err;
    }
  }
}

TEST_F(Target, PinsThatDoSomethingElseEndTheRun) {
  expect_end("pins", program::kExitLate, "the pins did not do what was commanded in tick 101");
}

TEST_F(Target, ACutLinkEndsTheRun) {
  expect_end("quit", program::kExitCouldNotRun,
             "the link to the firmware was cut at tick 100; QEMU ended: exit status 0");
  expect_end("junk", program::kExitCouldNotRun, "what came from the firmware at tick 100 is no message");
}

TEST_F(Target, AFirmwareThatSaysNothingEndsTheRun) {
  const End end = run("sabotage.elf", "silent@100", 0.5);
  EXPECT_EQ(end.exit_status, program::kExitCouldNotRun) << end.err;
  EXPECT_NE(end.err.find("silent for 0.5 s at tick 100"), std::string::npos) << end.err;
}

TEST_F(Target, AnotherFirmwareIsRefused) {
  expect_end("sources", program::kExitForeignFirmware, "does not fit this program: sources");
  expect_end("real", program::kExitForeignFirmware, "bytes of a real number: 2 there, 8 here");
}

// Double precision that says it is single: what it makes of the parameters gives it away.
TEST_F(Target, AnotherPrecisionThanItSaysIsRefused) {
  expect_end("single", program::kExitForeignFirmware, "the firmware's parameters are not this run's: fingerprint 0x");
}

TEST_F(Target, TheFirmwareOfAnotherBoardIsRefused) {
  const test::Folder folder;
  const auto run = [&](const std::string& played, const std::string& built) {
    return folder.run("ballast run paper_ball --firmware " + played + " --firmware-elf " BALLAST_BUILD_DIR "/" + built +
                      "/bin/ballast-" + built + ".elf --out r");
  };
  const test::Outcome single = run("qemu", "mps2_an386");
  EXPECT_EQ(single.exit_status, program::kExitForeignFirmware);
  EXPECT_NE(single.err.find("mps2_an386.elf is not built for mps2_an500, which QEMU plays"), std::string::npos)
      << single.err;
  // The Cortex-M4F could not even say so: it does not know the first instruction on a double.
  const test::Outcome wide = run("qemu-an386", "mps2_an500");
  EXPECT_EQ(wide.exit_status, program::kExitForeignFirmware);
  EXPECT_NE(wide.err.find("mps2_an500.elf is not built for mps2_an386, which QEMU plays"), std::string::npos)
      << wide.err;
}

// The Cortex-M4F's: what the two processors' startup code and fault registers could differ in.
TEST_F(Target, FaultsOfTheOtherProcessorSayWhatAndWhereToo) {
  board_ = "mps2_an386";
  expect_end("nothing", program::kExitCompleted, "");
  expect_end("undefined", program::kExitFirmwareFault, "faulted at tick 100: undefined instruction; pc 0x");
  expect_end("overflow", program::kExitFirmwareFault, "faulted at tick 100: its stack ran into the guard");
  expect_end("hang", program::kExitFirmwareHung, "hung at tick 100: its watchdog ended it; pc 0x");
  expect_end("late", program::kExitLate, "tick 100 is late");
}

TEST_F(Target, ParametersAreValidatedThere) {
  params_->motor[1].max_acceleration = -1;
  const End end = run("ballast-mps2_an500.elf", "");
  EXPECT_EQ(end.exit_status, program::kExitForeignFirmware);
  EXPECT_NE(end.err.find("refuses its parameters: mass 1: motor.max_acceleration = -1; allowed: "), std::string::npos)
      << end.err;
}

// The motion goes over the link as pieces and is built there: what came of it must be what this side has.
TEST_F(Target, OtherParametersThanThisSidesAreRefused) {
  scenario_.masses[2].motion[0].acceleration_start *= 1 + 1e-15;
  const End end = run("ballast-mps2_an500.elf", "");
  EXPECT_EQ(end.exit_status, program::kExitForeignFirmware);
  EXPECT_NE(end.err.find("the firmware's parameters are not this run's: fingerprint 0x"), std::string::npos) << end.err;
}

TEST_F(Target, APeriodTheBoardCannotKeepIsRefused) {
  params_->control_period_s = 0.7;  // 24 bits of 25 MHz end at 0.671 s
  for (std::size_t i = 0; i < scenario_.masses.size(); ++i) {
    scenario_.masses[i].motion.clear();
    params_->motor[i].max_step_rate_hz = 10;  // what a tick so long carries
    ASSERT_TRUE(params_->motion[i].set(scenario_.masses[i].initial_position, 0, nullptr, 0));
  }
  const End end = run("ballast-mps2_an500.elf", "");
  EXPECT_EQ(end.exit_status, program::kExitForeignFirmware);
  EXPECT_NE(end.err.find("this board cannot keep it"), std::string::npos) << end.err;
}

TEST_F(Target, AMissingFirmwareSaysHowToGetIt) {
  const test::Folder folder;
  const test::Outcome run = folder.run("ballast run paper_ball --firmware qemu --firmware-elf none.elf --out r");
  EXPECT_EQ(run.exit_status, program::kExitCouldNotRun);
  EXPECT_NE(run.err.find("none.elf: no such file; tools/firmware builds the firmware"), std::string::npos) << run.err;
}

TEST_F(Target, PrescribedAndProcessesAreRefused) {
  const test::Folder folder;
  EXPECT_EQ(folder.run("ballast run paper_ball --firmware qemu --actuation prescribed").exit_status,
            program::kExitUsage);
  EXPECT_EQ(folder.run("ballast run paper_ball --firmware qemu --processes").exit_status, program::kExitUsage);
  EXPECT_EQ(folder.entries(), 0);
}

// Paced so that the run would take minutes.
constexpr const char* kStart =
    "ballast run paper_ball --firmware qemu --speed 0.1 --out r & run=$!; i=0;"
    " while [ $i -lt 300 ] && [ \"$(stat -c %s r/run.lcmlog 2>/dev/null || echo 0)\" -le 20000 ];"
    " do sleep 0.1; i=$((i + 1)); done; qemu=$(pgrep -P $run qemu); ";

TEST_F(Target, KilledQemuEndsTheRun) {
  const test::Folder folder;
  const test::Outcome run = folder.run(std::string(kStart) + "kill -9 $qemu; wait $run; echo $?");
  EXPECT_NE(run.out.find("2\n"), std::string::npos) << run.out << run.err;
  EXPECT_NE(run.err.find("the link to the firmware was cut"), std::string::npos) << run.err;
  EXPECT_NE(run.err.find("QEMU ended: Killed"), std::string::npos) << run.err;
}

TEST_F(Target, StoppedQemuEndsTheRun) {
  const test::Folder folder;
  const test::Outcome run =
      folder.run(std::string(kStart) + "kill -STOP $qemu; wait $run; echo $?; kill -0 $qemu 2>/dev/null || echo gone");
  EXPECT_NE(run.out.find("2\ngone\n"), std::string::npos) << run.out << run.err;
  EXPECT_NE(run.err.find("the firmware is lost: silent for 2 s"), std::string::npos) << run.err;
}

TEST_F(Target, QemuGoesWithTheProgramThatStartedIt) {
  const test::Folder folder;
  for (const char* signal : {"-9", "-TERM"}) {
    const test::Outcome run =
        folder.run(std::string(kStart) + "[ -n \"$qemu\" ] && echo found; kill " + signal +
                   " $run; wait $run; i=0; while kill -0 $qemu 2>/dev/null && [ $i -lt 100 ]; do sleep 0.05; "
                   "i=$((i + 1)); done; kill -0 $qemu 2>/dev/null || echo gone; rm -r r");
    EXPECT_NE(run.out.find("found\ngone\n"), std::string::npos) << signal << run.out << run.err;
  }
}

}  // namespace
}  // namespace ballast
