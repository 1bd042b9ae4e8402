// The link's bytes: what goes in comes out, and nothing else gets through.
#include <gtest/gtest.h>

#include <random>

#include "hal/target/messages.h"
#include "tests/conformance/board_conformance.h"

namespace ballast::hal::test {
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(BoardConformance);  // only its random messages are wanted here
}

namespace ballast::hal::target {
namespace {

using test::bits;
using test::expect_same;
using test::random_sensors;
using test::random_status;
using test::random_steps;

TEST(Crc32, IsThatOfIeee8023) {
  const std::string_view text = "123456789";  // the check value of every catalogue of CRCs
  EXPECT_EQ(crc32({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}), 0xcbf43926u);
}

std::vector<std::uint8_t> frame_of(const auto& message, std::int64_t tick) {
  std::vector<std::uint8_t> bytes(kMaxFrame);
  bytes.resize(encode(message, tick, bytes));
  return bytes;
}

TEST(TargetLink, MessagesArriveBitForBit) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  for (int round = 0; round < 200; ++round) {
    const auto tick = static_cast<std::int64_t>(random());
    World world;
    world.last = random() % 2 == 0;
    world.sensors = random_sensors(random, tick);
    world.verdict = {tick, random() % 2 == 0};
    world.command_count = 2;
    world.commands[0] = firmware::OperatorCommand::kStop;
    firmware::MoveRequest move;
    move.masses = static_cast<std::uint32_t>(random());
    move.target_position[3] = test::any_double(random);
    world.commands[1] = move;
    Frame frame;
    const auto bytes = frame_of(world, tick);
    ASSERT_EQ(decode_frame(bytes, frame).error, FrameError::kNone);
    EXPECT_EQ(frame.tick, tick);
    World read;
    ASSERT_TRUE(decode(frame, read));
    EXPECT_EQ(read.last, world.last);
    expect_same(read.sensors, world.sensors);
    EXPECT_EQ(read.verdict.tripped, world.verdict.tripped);
    ASSERT_EQ(read.command_count, 2);
    EXPECT_EQ(bits(read.commands[1].move.target_position[3]), bits(move.target_position[3]));

    auto reply = std::make_unique<Reply>(), read_reply = std::make_unique<Reply>();
    reply->status = random_status(random, tick);
    reply->steps = random_steps(random, tick, static_cast<int>(random() % (firmware::kMaxBursts + 1)));
    reply->played.count = 3;
    reply->played.pulse[2] = {static_cast<std::uint32_t>(random()), 7, 5, -1};
    const auto reply_bytes = frame_of(*reply, tick);
    ASSERT_EQ(decode_frame(reply_bytes, frame).error, FrameError::kNone);
    ASSERT_TRUE(decode(frame, *read_reply));
    expect_same(read_reply->status, reply->status);
    expect_same(read_reply->steps, reply->steps);
    EXPECT_EQ(read_reply->played.pulse[2].due_ticks, reply->played.pulse[2].due_ticks);
    EXPECT_FALSE(decode(frame, read)) << "a reply is not a world";
  }
}

// Every cut and every flipped bit of a frame is seen.
TEST(TargetLink, DamagedFramesAreRefused) {
  const auto bytes = frame_of(World{}, 5);
  Frame frame;
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const FrameResult result = decode_frame(std::span(bytes).first(size), frame);
    EXPECT_EQ(result.error, FrameError::kIncomplete);
    EXPECT_GT(result.needed, size);
  }
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    auto damaged = bytes;
    damaged[bit / 8] ^= static_cast<std::uint8_t>(1 << bit % 8);
    EXPECT_NE(decode_frame(damaged, frame).error, FrameError::kNone) << bit;
  }
}

template <class M>
void decode_noise(std::mt19937_64& random) {
  const auto good = std::make_unique<M>(), out = std::make_unique<M>();
  const auto bytes = frame_of(*good, 1);
  for (int round = 0; round < 1000; ++round) {
    std::vector<std::uint8_t> payload(bytes.begin() + kHeaderSize, bytes.end() - kTrailerSize);
    for (int n = 0; n < 1 + round % 20 && !payload.empty(); ++n) {
      payload[random() % payload.size()] = static_cast<std::uint8_t>(random());
    }
    if (round % 3 == 0) payload.resize(random() % (2 * payload.size() + 1));
    std::vector<std::uint8_t> framed(kMaxFrame);
    framed.resize(encode_frame(framed, kTypeOf<M>, 1, [&](Writer& writer) {
      for (const std::uint8_t byte : payload) writer(byte);
    }));
    Frame frame;
    ASSERT_EQ(decode_frame(framed, frame).error, FrameError::kNone);
    // What is accepted is in range: it can be said again, in as many bytes.
    if (decode(frame, *out)) {
      EXPECT_EQ(frame_of(*out, 1).size(), framed.size());
    }
  }
}

TEST(TargetLink, NoiseNeverGetsThrough) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  decode_noise<Hello>(random);
  decode_noise<firmware::ControllerParams>(random);
  decode_noise<MassParams>(random);
  decode_noise<Commit>(random);
  decode_noise<Verdict>(random);
  decode_noise<World>(random);
  decode_noise<Reply>(random);
  decode_noise<LastWords>(random);
  decode_noise<Farewell>(random);
  for (int round = 0; round < 10000; ++round) {
    std::vector<std::uint8_t> bytes(random() % 64);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    Frame frame;
    EXPECT_NE(decode_frame(bytes, frame).error, FrameError::kNone);
  }
}

TEST(TargetLink, StepsOutOfRangeAreRefused) {
  const auto refused = [](auto change) {
    auto reply = std::make_unique<Reply>(), out = std::make_unique<Reply>();
    reply->steps.motor_count = 2;
    reply->steps.burst_count = 1;
    reply->steps.bursts[0] = {.motor = 1, .direction = -1, .count = 1};
    const auto good = frame_of(*reply, 0);
    Frame frame;
    EXPECT_EQ(decode_frame(good, frame).error, FrameError::kNone);
    EXPECT_TRUE(decode(frame, *out));
    change(reply->steps.bursts[0]);
    const auto bad = frame_of(*reply, 0);
    EXPECT_EQ(decode_frame(bad, frame).error, FrameError::kNone);
    EXPECT_FALSE(decode(frame, *out));
  };
  refused([](firmware::StepBurst& b) { b.motor = 2; });
  refused([](firmware::StepBurst& b) { b.direction = 0; });
  refused([](firmware::StepBurst& b) { b.count = 0; });
  refused([](firmware::StepBurst& b) { b.first_ticks = -1; });
  refused([](firmware::StepBurst& b) { b.interval_ticks = -1; });
}

}  // namespace
}  // namespace ballast::hal::target
