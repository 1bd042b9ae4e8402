// Link and LinkBoard on a machine of the test's own: bytes in any pieces, late ticks, floods of commands.
#include "hal/target/link_board.h"

#include <gtest/gtest.h>

#include <deque>
#include <random>

#include "hal/board.h"
#include "tests/random_seed.h"

namespace ballast::hal::target {
namespace {

struct FakeMachine {
  static constexpr const char* kName = "fake";
  static constexpr std::uint32_t kCounterHz = 1000000;

  Status read(std::span<std::uint8_t> bytes, std::size_t& count) {
    if (incoming.empty()) return Status::kPeerLost;
    count = std::min({bytes.size(), incoming.size(), std::size_t{1} + chunk() % most_at_once});
    std::copy_n(incoming.begin(), count, bytes.begin());
    incoming.erase(incoming.begin(), incoming.begin() + static_cast<std::ptrdiff_t>(count));
    return Status::kOk;
  }
  Status write(std::span<const std::uint8_t>) { return Status::kOk; }
  bool start(const firmware::ControllerParams&, const Commit&) { return true; }
  // As on a board: the ticks that have begun since the last call, or the next one.
  std::uint32_t wait_tick() {
    const std::uint32_t since = std::max(begun, 1u);
    begun = 0;
    return since;
  }
  [[nodiscard]] bool tick_due() const { return begun > 0; }
  [[nodiscard]] std::uint32_t counter() const { return 0; }
  void load(const firmware::StepCommand&) {}
  void played(PlayedPulses&) const {}
  void kick_watchdog() {}
  void report(EndReport&) const {}

  void send(const World& world, std::int64_t tick) {
    std::vector<std::uint8_t> bytes(kMaxFrame);
    bytes.resize(encode(world, tick, bytes));
    ASSERT_GT(bytes.size(), 0u);
    incoming.insert(incoming.end(), bytes.begin(), bytes.end());
  }

  std::deque<std::uint8_t> incoming;
  std::mt19937_64 chunk;
  std::size_t most_at_once = kMaxFrame;
  std::uint32_t begun = 0;  // control ticks since the last wait_tick()
};
static_assert(Machine<FakeMachine>);

class TargetLinkBoard : public testing::Test {
 protected:
  // Serves one tick; `commands` come with it.
  void serve(std::initializer_list<firmware::OperatorInput> commands = {}) {
    World world;
    for (const auto& command : commands) world.commands[static_cast<std::size_t>(world.command_count++)] = command;
    machine_.send(world, tick_);
    std::int64_t tick = -99;
    ASSERT_EQ(board_.wait_tick(tick), Status::kOk);
    ASSERT_EQ(tick, tick_++);
  }

  FakeMachine machine_;
  Link<FakeMachine> link_{machine_};
  LinkBoard<FakeMachine> board_{machine_, link_};
  std::int64_t tick_ = 0;
};

TEST_F(TargetLinkBoard, ALateTickIsNotForgotten) {
  machine_.begun = 5;  // before the first tick nobody serves any
  serve();
  EXPECT_EQ(board_.overruns(), 0);
  serve();
  EXPECT_EQ(board_.overruns(), 0);
  machine_.begun = 1;  // while this tick is served
  EXPECT_EQ(board_.overruns(), 1);
  serve();
  EXPECT_EQ(board_.overruns(), 1);
  machine_.begun = 3;
  serve();
  EXPECT_EQ(board_.overruns(), 4);
  serve();
  EXPECT_EQ(board_.overruns(), 4);
}

TEST_F(TargetLinkBoard, AStopIsNeverLost) {
  using enum firmware::OperatorCommand;
  for (int i = 0; i < 3; ++i) serve({kReset, kArm, kReset, kArm});
  EXPECT_EQ(board_.counters().dropped, 12 - kMaxCommands);
  serve({kStop});
  EXPECT_EQ(board_.counters().dropped, 12);
  for (int i = 0; i < 10; ++i) serve({kArm, kStart, kArm, kStart, kArm, kStart, kArm, kStart});
  firmware::OperatorInput command;
  ASSERT_EQ(board_.read_operator(command), Status::kOk);
  EXPECT_EQ(command.command, kStop);
  for (int i = 1; i < kMaxCommands; ++i) {
    ASSERT_EQ(board_.read_operator(command), Status::kOk);
    EXPECT_EQ(command.command, i % 2 == 1 ? kArm : kStart);
  }
  EXPECT_EQ(board_.read_operator(command), Status::kEmpty);
  EXPECT_EQ(board_.counters().dropped, 12 + 80 - (kMaxCommands - 1));
  EXPECT_EQ(board_.counters().malformed, 0);
}

// Frames arrive whole, however the stream is cut into pieces.
TEST(TargetLink, FramesComeWholeOutOfAnyPieces) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  for (const std::size_t most : {std::size_t{1}, std::size_t{7}, std::size_t{400}, kMaxFrame}) {
    FakeMachine machine;
    machine.chunk.seed(seed);
    machine.most_at_once = most;
    World world;
    for (int i = 0; i < 50; ++i) machine.send(world, i);
    Link<FakeMachine> link(machine);
    for (int i = 0; i < 50; ++i) {
      Frame frame;
      ASSERT_EQ(link.receive(frame), Status::kOk);
      EXPECT_EQ(frame.tick, i);
      EXPECT_TRUE(decode(frame, world));
    }
    Frame frame;
    EXPECT_EQ(link.receive(frame), Status::kPeerLost);
  }
}

// Bytes after garbage are not searched for a frame: it could be an old one.
TEST(TargetLink, GarbageBetweenFramesEndsTheLink) {
  FakeMachine machine;
  machine.send({}, 0);
  for (int i = 0; i < 30; ++i) machine.incoming.push_back(static_cast<std::uint8_t>('A' + i));
  machine.send({}, 1);
  Link<FakeMachine> link(machine);
  Frame frame;
  ASSERT_EQ(link.receive(frame), Status::kOk);
  EXPECT_EQ(link.receive(frame), Status::kIo);
  EXPECT_EQ(link.receive(frame), Status::kIo);
}

// A frame that promises too many bytes is waited for up to the length of the longest frame.
TEST(TargetLink, AFrameThatPromisesTooMuchEndsTheLink) {
  for (const std::uint32_t length : {std::uint32_t{kMaxPayload}, std::uint32_t{kMaxPayload} + 1, 0xffffffffu}) {
    FakeMachine machine;
    machine.send({}, 0);
    for (std::size_t i = 0; i < 4; ++i) machine.incoming[8 + i] = static_cast<std::uint8_t>(length >> 8 * i);
    for (int i = 0; i < 200; ++i) machine.send({}, 1);
    Link<FakeMachine> link(machine);
    Frame frame;
    EXPECT_EQ(link.receive(frame), Status::kIo) << length;
  }
}

}  // namespace
}  // namespace ballast::hal::target
