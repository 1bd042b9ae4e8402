// The longest control tick on the microcontrollers, requests for a stop and a move included. Instructions, as QEMU
// counts them: the same every time.
#include "tests/target/worst_tick.h"

#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <memory>

#include "hal/target/wire.h"
#include "sim/scenario/reader.h"
#include "tools/benchmarks/target_run.h"
#include "tools/qemu/qemu_process.h"

namespace ballast {
namespace {

using Worst = std::array<hal::test::WorstTicks, hal::test::kWorstTickMasses.size()>;

std::uint32_t instructions(std::uint32_t counts) { return static_cast<std::uint32_t>(std::lround(counts / 6.4)); }

Worst on_the_target(const std::string& board) {
  Worst worst;
  sil::QemuProcess qemu;
  const auto why = qemu.start({.board = board,
                               .elf = std::string(BALLAST_BUILD_DIR) + "/" + board + "/bin/worst_tick.elf",
                               .icount_shift = benchmarks::kInstructionShift});
  EXPECT_EQ(why, "");
  std::vector<std::uint8_t> bytes;
  while (bytes.size() < hal::test::kWorstTickBytes) {
    if (qemu.read(0, bytes, sil::Seconds(120), nullptr) != hal::Status::kOk) {
      ADD_FAILURE() << "worst_tick.elf ended: " << qemu.ended(sil::Seconds(1)) << ' ' << qemu.messages();
      return worst;
    }
  }
  hal::target::Reader in(bytes);
  hal::test::worst_tick_fields(in, worst);
  EXPECT_TRUE(in.complete());
  return worst;
}

// Instructions for each number of masses.
using Allowed = std::array<std::uint32_t, 3>;

void expect_at_most(const std::string& board, const Allowed& run_or_stop, const Allowed& move) {
  const Worst worst = on_the_target(board);
  for (std::size_t i = 0; i < worst.size(); ++i) {
    const hal::test::WorstTicks& w = worst[i];
    SCOPED_TRACE(::testing::Message() << board << ", " << w.masses << " masses");
    EXPECT_EQ(w.masses, static_cast<std::uint32_t>(hal::test::kWorstTickMasses[i]));
    EXPECT_EQ(w.predicted_stops, hal::test::kStopTicks.size());
    EXPECT_EQ(w.predicted_moves, 1u);
    EXPECT_GT(w.pulses, 300u);
    EXPECT_GT(w.run, 0u);
    EXPECT_LE(instructions(w.run), run_or_stop[i]);
    EXPECT_LE(instructions(w.stop), run_or_stop[i]);
    EXPECT_LE(instructions(w.move), move[i]);
    std::cout << board << ", " << w.masses << (w.masses == 1 ? " mass" : " masses") << ": run " << instructions(w.run)
              << ", stop " << instructions(w.stop) << ", move " << instructions(w.move) << " instructions at most\n";
  }
}

// 25,000 is the project's bar for three masses. Eight may take a tenth of a 1 kHz tick at 480 MHz.
TEST(WorstTick, OfTheCortexM7) { expect_at_most("mps2_an500", {25000, 25000, 48000}, {25000, 25000, 48000}); }

// At 180 MHz, an instruction a clock, three masses run, stop and move at 1 kHz. Eight run and stop at 400 Hz, and move
// at 350 Hz.
TEST(WorstTick, OfTheCortexM4F) { expect_at_most("mps2_an386", {180000, 180000, 450000}, {180000, 180000, 500000}); }

// 100,000 is the project's bar for three masses with everything on. A push leaves states without an acceleration that
// keeps the cone; a halt is predicted beside the search for its certificate.
TEST(WorstTick, GovernedOfTheCortexM7) {
  auto read =
      sim::read_scenario(BALLAST_SCENARIO_DIR "/desk_ball.toml",
                         {"duration=2.5", "control.governor=true", "control.friction_use=1", "control.tracking=true",
                          "believed.ball.mass=0.82", "sensors.preset=bmi088_calibrated", "sensors.latency=0.005",
                          "sensors.position_fix.rate=10", "run.hold=0.5"});
  ASSERT_TRUE(read.ok());
  sim::Fault push;
  push.kind = sim::FaultKind::kPush;
  push.time_s = 0.5;
  push.end_s = 0.6;
  push.value = 3.2;
  push.direction_W = {0.6, 0.8, 0};
  read.scenario.faults = {push};
  const auto programs = std::filesystem::path(BALLAST_BUILD_DIR) / "mps2_an500/bin";
  const auto run = benchmarks::count_instructions(read.scenario, "mps2_an500", programs,
                                                  {.commands = {{1500, firmware::OperatorCommand::kHalt}}});
  EXPECT_FALSE(run.tripped);
  EXPECT_LE(run.record.max_instructions, 100000) << "in tick " << run.record.max_tick;
  std::cout << "governed: " << run.record.max_instructions << " instructions at most\n";
}

}  // namespace
}  // namespace ballast
