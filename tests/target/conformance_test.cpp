// The boards in QEMU, Cortex-M7 and Cortex-M4F, under the suite of every backend.
#include "tests/target/qemu_world.h"

namespace ballast::hal::test {
namespace {

INSTANTIATE_TYPED_TEST_SUITE_P(CortexM7, BoardConformance, QemuWorld<Mps2An500>);
INSTANTIATE_TYPED_TEST_SUITE_P(CortexM4F, BoardConformance, QemuWorld<Mps2An386>);

template <class Target>
class TargetLinkConformance : public testing::Test {};
using Targets = testing::Types<Mps2An500, Mps2An386>;
TYPED_TEST_SUITE(TargetLinkConformance, Targets);

TYPED_TEST(TargetLinkConformance, AMessageThatIsNoneEndsTheBoardsTicks) {
  sil::QemuProcess qemu;
  ASSERT_EQ(qemu.start(conformance_program<TypeParam>()), "");
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
