// The boards in QEMU, Cortex-M7 and Cortex-M4F, under the suite of every backend.
#include <bit>
#include <limits>
#include <random>

#include "tests/random_seed.h"
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

// The board brings its own casts of 64 bits (hal/mps2/startup.cpp): rounded once, to even where two are as near.
TYPED_TEST(TargetLinkConformance, IntegersOf64BitsBecomeTheNearestDouble) {
  sil::QemuProcess qemu;
  ASSERT_EQ(qemu.start(conformance_program<TypeParam>()), "");
  const RemoteBoard board(qemu);
  std::vector<std::int64_t> numbers{0, std::numeric_limits<std::int64_t>::min(),
                                    std::numeric_limits<std::int64_t>::max()};
  for (int bit = 0; bit < 63; ++bit) {
    for (const std::int64_t near : {-3, -2, -1, 0, 1, 2, 3}) {
      const std::int64_t n = (std::int64_t{1} << bit) + near;
      numbers.insert(numbers.end(), {n, -n});
      // Half way between two doubles, and beside it.
      if (bit > 53) numbers.push_back((std::int64_t{1} << bit) + (std::int64_t{3} << (bit - 54)) + near);
    }
  }
  std::mt19937_64 random(ballast::test::random_seed(20261122));
  for (int i = 0; i < 500; ++i) numbers.push_back(static_cast<std::int64_t>(random()) >> (random() % 64));
  for (const std::int64_t n : numbers) {
    const auto [with_sign, without] = board.to_double(n);
    EXPECT_EQ(std::bit_cast<std::uint64_t>(with_sign), std::bit_cast<std::uint64_t>(static_cast<double>(n))) << n;
    EXPECT_EQ(std::bit_cast<std::uint64_t>(without),
              std::bit_cast<std::uint64_t>(static_cast<double>(static_cast<std::uint64_t>(n))))
        << n;
  }
}

}  // namespace
}  // namespace ballast::hal::test
