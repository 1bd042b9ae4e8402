// More to step than there are bursts: the tick that finds it makes its steps over again and predicts the stop, and has
// to be done within a control tick of 1 kHz on the microcontroller too.
#include <gtest/gtest.h>

#include <iostream>
#include <memory>

#include "hal/target/wire.h"
#include "tests/target/overload_load.h"
#include "tools/qemu/qemu_process.h"

namespace ballast {
namespace {

using hal::test::kOverloadRobots;
using Loads = std::array<hal::test::OverloadLoad, kOverloadRobots.size()>;

// An instruction takes 256 ns of the machine's time, 6.4 counts of its 25 MHz: whole instructions come of whole counts.
constexpr int kShift = 8;
std::uint32_t instructions(std::uint32_t counts) {
  return static_cast<std::uint32_t>(counts * 40.0 / (1 << kShift) + 0.5);  // NOLINT(bugprone-incorrect-roundings): > 0
}

Loads on_the_target(const std::string& board) {
  Loads loads;
  sil::QemuProcess qemu;
  EXPECT_EQ(qemu.start({.board = board,
                        .elf = std::string(BALLAST_BUILD_DIR) + "/" + board + "/bin/overload.elf",
                        .icount_shift = kShift}),
            "");
  std::vector<std::uint8_t> bytes;
  while (bytes.size() < hal::test::kOverloadBytes) {
    if (qemu.read(0, bytes, sil::Seconds(120), nullptr) != hal::Status::kOk) {
      ADD_FAILURE() << "overload.elf ended: " << qemu.ended(sil::Seconds(1)) << ' ' << qemu.said();
      return loads;
    }
  }
  hal::target::Reader in(bytes);
  hal::test::overload_fields(in, loads);
  EXPECT_TRUE(in.complete());
  return loads;
}

Loads on_the_host() {
  Loads loads;
  const auto params = std::make_unique<firmware::ControllerParams>();
  const auto state = std::make_unique<firmware::ControllerState>();
  const auto inputs = std::make_unique<firmware::Inputs>();
  const auto outputs = std::make_unique<firmware::Outputs>();
  for (std::size_t i = 0; i < loads.size(); ++i) {
    EXPECT_TRUE(hal::test::measure_overloads(
        kOverloadRobots[i], [] { return 0u; }, *params, *state, *inputs, *outputs, loads[i]));
  }
  return loads;
}

TEST(Overload, IsServedWithinATickOfTheCortexM7) {
  const Loads target = on_the_target("mps2_an500"), host = on_the_host();
  ASSERT_FALSE(HasFailure());
  for (std::size_t i = 0; i < target.size(); ++i) {
    const auto& robot = kOverloadRobots[i];
    const hal::test::OverloadLoad &there = target[i], &here = host[i];
    SCOPED_TRACE(::testing::Message() << robot.motors << " motors, " << robot.timer_hz << " Hz, to rest in "
                                      << robot.fastest_ticks << " to " << robot.slowest_ticks << " ticks");
    EXPECT_GT(there.overloads, 0u) << "without an overload nothing is measured";
    EXPECT_EQ(there.rested, there.overloads) << "every overload ends in rest";
    EXPECT_EQ(there.overloads, here.overloads);
    EXPECT_EQ(there.checksum, here.checksum) << "the pulses are the host's";
    // A tick of 1 kHz at 480 MHz, and at 216 MHz, an instruction a clock.
    EXPECT_LT(instructions(there.counts_overload), 480000u);
    EXPECT_LT(instructions(there.counts_stop), 216000u);
    std::cout << robot.motors << " motors, " << robot.timer_hz << " Hz, to rest in " << robot.fastest_ticks << " to "
              << robot.slowest_ticks << " ticks: " << there.overloads << " overloads, at most "
              << instructions(there.counts_overload) << " instructions in their tick, "
              << instructions(there.counts_stop) << " in one of the stop, " << instructions(there.counts_before)
              << " before\n";
  }
}

}  // namespace
}  // namespace ballast
