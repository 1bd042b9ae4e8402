// The Cortex-M7's board, in QEMU, under the suite of every backend.
#include "tests/target/qemu_world.h"

namespace ballast::hal::test {
namespace {

INSTANTIATE_TYPED_TEST_SUITE_P(Mps2An500, BoardConformance, QemuWorld);

TEST(Mps2An500, AMessageThatIsNoneEndsTheBoardsTicks) {
  sil::QemuProcess qemu;
  ASSERT_EQ(qemu.start({.elf = BALLAST_TARGET_DIR "/conformance.elf", .pipe_pairs = 2}), "");
  RemoteBoard board(qemu);
  std::vector<std::uint8_t> bytes(target::kMaxFrame);
  bytes.resize(target::encode(target::World{}, 0, bytes));
  bytes[30] ^= 1;
  ASSERT_EQ(qemu.write(kLinkPair, bytes, kPatience), Status::kOk);
  std::int64_t tick = -99;
  EXPECT_EQ(board.wait_tick(tick), Status::kIo);
  EXPECT_EQ(tick, -99);
}

}  // namespace
}  // namespace ballast::hal::test
