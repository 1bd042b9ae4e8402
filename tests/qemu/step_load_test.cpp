// The steps a motion of several motors needs, on the microcontrollers: none missed beside the whole controller tick,
// and what they cost. Instructions, as QEMU counts them: the same every time.
#include "tests/target/step_load.h"

#include <gtest/gtest.h>

#include "hal/target/wire.h"
#include "tools/qemu/qemu_process.h"

namespace ballast {
namespace {

constexpr int kShift = 2;                                       // an instruction takes 4 ns,
constexpr double kInstructionsPerTick = 1e6 / (1 << kShift);    // a control tick a millisecond
constexpr double kInstructionsPerCount = 40.0 / (1 << kShift);  // and a count of the machine's 25 MHz 40 ns
constexpr double kMostPerStep = 70;                             // instructions

hal::test::StepLoad load_of(const std::string& board) {
  hal::test::StepLoad load;
  sil::QemuProcess qemu;
  const auto why = qemu.start({.board = board,
                               .elf = std::string(BALLAST_BUILD_DIR) + "/" + board + "/bin/step_load.elf",
                               .icount_shift = kShift});
  EXPECT_EQ(why, "");
  std::vector<std::uint8_t> bytes;
  while (bytes.size() < hal::test::kStepLoadBytes) {
    if (qemu.read(0, bytes, sil::Seconds(120), nullptr) != hal::Status::kOk) {
      ADD_FAILURE() << "step_load.elf ended: " << qemu.ended(sil::Seconds(1)) << ' ' << qemu.messages();
      return load;
    }
  }
  hal::target::Reader in(bytes);
  hal::test::step_load_fields(in, load);
  EXPECT_TRUE(in.complete());
  return load;
}

void expect_nothing_missed(const hal::test::StepLoad& load) {
  for (const hal::test::TogetherLoad& t : load.together) {
    SCOPED_TRACE(::testing::Message() << t.motors << " motors");
    EXPECT_EQ(t.faults, 0u);
    EXPECT_EQ(t.late_ticks, 0u);
    EXPECT_EQ(t.commanded, t.steps_per_tick * t.motors * hal::test::kLoadTicks);
    EXPECT_EQ(t.given, t.commanded);
    // One interrupt gives the pulses of all motors, which are due at the same count. The last of them is late by what
    // the interrupt takes, at most kMostPerStep for each, and the count at which it begins.
    EXPECT_LE(t.late_counts, t.motors * kMostPerStep / kInstructionsPerCount + 1);
  }
}

TEST(StepLoad, FiftyKilohertzOnThreeMotorsBesideTheWholeTick) {
  const hal::test::StepLoad load = load_of("mps2_an500");
  expect_nothing_missed(load);
  ASSERT_FALSE(HasFailure());
  for (const hal::test::TogetherLoad& t : load.together) {
    const double per_turn = kInstructionsPerTick * t.period_us / 1000 * hal::test::kLoadTicks / t.turns_idle;
    const double per_step = per_turn * (static_cast<double>(t.turns_tick) - t.turns_pulses) / t.given;
    EXPECT_GT(per_step, 0);
    // Klipper's docs/Benchmarks.md, STM32H723, commit 554ae78d: 70 clocks a step with one stepper; 181 for three that
    // step at the same clock, as these do.
    EXPECT_LT(per_step, t.motors == 1 ? kMostPerStep : 60) << t.motors << " motors";
  }
  for (const hal::test::GeneratorLoad& g : load.generator) {
    ASSERT_GT(g.pulses, 0u);
    if (g.steps_per_tick != 0) {
      EXPECT_EQ(g.pulses, g.ticks * g.steps_per_tick);
    }
    // Less than a step's interrupt takes, where a tick has enough steps for its fixed cost to matter little.
    if (g.steps_per_tick == 20) {
      EXPECT_LT(kInstructionsPerCount * g.counts / g.pulses, 60);
    }
  }
}

// In single precision, where a tick is ten times as long.
TEST(StepLoad, FiftyKilohertzOnThreeMotorsOfTheOtherProcessor) { expect_nothing_missed(load_of("mps2_an386")); }

}  // namespace
}  // namespace ballast
