// Messages of the link arrive unchanged, and no other bytes are accepted.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <random>

#include "hal/target/messages.h"
#include "tests/conformance/random_message.h"
#include "tests/random_seed.h"

namespace ballast::hal::target {
namespace {

using test::expect_same;

TEST(Crc32, IsThatOfIeee8023) {
  const std::string_view text = "123456789";  // the check value of every catalogue of CRCs
  EXPECT_EQ(crc32({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}), 0xcbf43926u);
}

std::vector<std::uint8_t> frame_of(const auto& message, std::int64_t tick) {
  std::vector<std::uint8_t> bytes(kMaxFrame);
  bytes.resize(encode(message, tick, bytes));
  return bytes;
}

template <class M>
void expect_to_arrive(std::mt19937_64& random) {
  const auto sent = std::make_unique<M>(), received = std::make_unique<M>();
  for (int round = 0; round < 100; ++round) {
    test::randomize(*sent, random);
    const auto tick = static_cast<std::int64_t>(random());
    const auto bytes = frame_of(*sent, tick);
    Frame frame;
    ASSERT_EQ(decode_frame(bytes, frame).error, FrameError::kNone);
    EXPECT_EQ(frame.tick, tick);
    EXPECT_EQ(frame.type, type_of(Tag<M>()));
    ASSERT_TRUE(decode(frame, *received));
    expect_same(*received, *sent);
    Commit commit;
    World world;
    EXPECT_EQ(decode(frame, commit), (std::is_same_v<M, Commit>));
    EXPECT_EQ(decode(frame, world), (std::is_same_v<M, World>));
  }
}

// Calls visitor.operator()<M>() for every message of the link.
template <class Visitor>
void for_every_message(const Visitor& visitor) {
  visitor.template operator()<Hello>();
  visitor.template operator()<firmware::ControllerParams>();
  visitor.template operator()<MassParams>();
  visitor.template operator()<ReferencePart>();
  visitor.template operator()<Commit>();
  visitor.template operator()<Verdict>();
  visitor.template operator()<World>();
  visitor.template operator()<Reply>();
  visitor.template operator()<FaultReport>();
  visitor.template operator()<EndReport>();
}

TEST(TargetLink, MessagesArriveBitForBit) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  for_every_message([&]<class M>() { expect_to_arrive<M>(random); });
}

// The host reads LinkBoard's ReplyView as a Reply.
TEST(TargetLink, AReplyIsSentFromWhereItsPartsLie) {
  std::mt19937_64 random(1);
  const auto reply = std::make_unique<Reply>();
  test::randomize(*reply, random);
  EXPECT_EQ(frame_of(*reply, 1),
            frame_of(ReplyView{reply->status, reply->steps, reply->tick_counts, reply->played}, 1));
}

// Every cut and every flipped bit of a frame is detected.
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

// A good frame with some bytes of its header changed, with a new checksum or the old one.
std::vector<std::uint8_t> changed(std::size_t at, std::uint64_t value, std::size_t size, bool new_checksum) {
  auto bytes = frame_of(World{}, 5);
  for (std::size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<std::uint8_t>(value >> 8 * i);
  if (new_checksum) {
    Writer trailer{std::span(bytes).last(kTrailerSize)};
    trailer(crc32(std::span<const std::uint8_t>(bytes).first(bytes.size() - kTrailerSize)));
  }
  return bytes;
}

TEST(TargetLink, EveryFrameErrorHasItsCause) {
  const auto error_of = [](std::span<const std::uint8_t> bytes) {
    Frame frame{.type = MessageType::kReference, .tick = 4711, .payload = {}};
    const FrameResult result = decode_frame(bytes, frame);
    if (result.error != FrameError::kNone) {
      EXPECT_EQ(frame.type, MessageType::kReference);
      EXPECT_EQ(frame.tick, 4711) << "untouched on failure";
      EXPECT_EQ(frame.payload.size(), 0u);
    }
    return result.error;
  };
  for (const bool checksum : {false, true}) {
    EXPECT_EQ(error_of(changed(0, 0x54534c43, 4, checksum)), FrameError::kNotAFrame);
    EXPECT_EQ(error_of(changed(4, kProtocolVersion + 1, 2, checksum)), FrameError::kVersion);
    for (const std::uint64_t type : {0, 11, 0xffff}) {
      EXPECT_EQ(error_of(changed(6, type, 2, checksum)), FrameError::kType);
    }
    for (const std::uint32_t length : {std::uint32_t{kMaxPayload} + 1, 0x7fffffffu, 0xffffffffu}) {
      EXPECT_EQ(error_of(changed(8, length, 4, checksum)), FrameError::kLength);
    }
  }
  // Lengths shorter than the payload, and longer ones up to the limit.
  const auto good = frame_of(World{}, 5);
  const std::size_t payload = good.size() - kHeaderSize - kTrailerSize;
  for (const std::size_t length : {std::size_t{0}, std::size_t{1}, payload - 1}) {
    EXPECT_EQ(error_of(changed(8, length, 4, true)), FrameError::kChecksum) << length;
  }
  Frame frame;
  for (const std::size_t length : {payload + 1, kMaxPayload}) {
    const FrameResult result = decode_frame(changed(8, length, 4, true), frame);
    EXPECT_EQ(result.error, FrameError::kIncomplete);
    EXPECT_EQ(result.needed, kHeaderSize + length + kTrailerSize);
    auto longer = changed(8, length, 4, true);
    longer.resize(result.needed);
    EXPECT_EQ(error_of(longer), FrameError::kChecksum);
  }
  auto bad_checksum = good;
  bad_checksum.back() ^= 0x80;
  EXPECT_EQ(error_of(bad_checksum), FrameError::kChecksum);
  // Bytes after a frame do not belong to it.
  auto followed = good;
  followed.insert(followed.end(), 100, 0xff);
  const FrameResult result = decode_frame(followed, frame);
  EXPECT_EQ(result.error, FrameError::kNone);
  EXPECT_EQ(result.size, good.size());
  EXPECT_EQ(error_of(std::span(followed).subspan(good.size())), FrameError::kNotAFrame);
  // Another tick with its checksum is a good frame; the receiver judges the tick.
  EXPECT_EQ(error_of(changed(12, 6, 8, false)), FrameError::kChecksum);
  EXPECT_EQ(error_of(changed(12, 6, 8, true)), FrameError::kNone);
}

// Whether a good frame around this payload decodes.
template <class M>
bool decodes(const std::vector<std::uint8_t>& payload, M& out) {
  std::vector<std::uint8_t> framed(kMaxFrame);
  framed.resize(encode_frame(framed, type_of(Tag<M>()), 1, [&](Writer& writer) {
    for (const std::uint8_t byte : payload) writer(byte);
  }));
  Frame frame;
  EXPECT_EQ(decode_frame(framed, frame).error, FrameError::kNone);
  return decode(frame, out);
}

template <class M>
std::vector<std::uint8_t> payload_of(const M& message) {
  const auto bytes = frame_of(message, 1);
  return {bytes.begin() + kHeaderSize, bytes.end() - kTrailerSize};
}

TEST(TargetLink, ATextEndsInsideItsPlace) {
  Hello hello;
  hello.board = "0123456789012345678901234567890123456789";  // cut to 31 characters
  Hello out;
  const auto good = payload_of(hello);
  ASSERT_TRUE(decodes(good, out));
  EXPECT_STREQ(out.board.c_str(), "0123456789012345678901234567890");
  const std::size_t last = good.size() - sizeof hello.counter_hz - 1;
  auto endless = good;
  endless[last] = 'x';
  EXPECT_FALSE(decodes(endless, out));
  endless.insert(endless.begin() + static_cast<std::ptrdiff_t>(last) + 1, 0);  // nor one byte later
  EXPECT_FALSE(decodes(endless, out));
  for (const int character : {0x80, 0xff}) {
    auto strange = good;
    strange[last - 1] = static_cast<std::uint8_t>(character);
    EXPECT_FALSE(decodes(strange, out));
  }
}

TEST(TargetLink, CountsThatLieAreRefused) {
  World world;
  world.command_count = 2;
  world.commands[0] = firmware::OperatorCommand::kArm;
  world.commands[1] = firmware::OperatorCommand::kStart;
  const auto good = payload_of(world);
  World out;
  ASSERT_TRUE(decodes(good, out));
  const std::size_t count_at = good.size() - 2 - sizeof world.command_count;
  for (const std::int32_t count : {-1, 0, 1, 3, kMaxCommands, kMaxCommands + 1, 0x7fffffff}) {
    auto lying = good;
    std::memcpy(lying.data() + count_at, &count, sizeof count);
    EXPECT_FALSE(decodes(lying, out)) << count;
  }
  for (const int command : {0, 7, 255}) {
    auto unknown = good;
    unknown.back() = static_cast<std::uint8_t>(command);
    EXPECT_FALSE(decodes(unknown, out)) << command;
  }
  auto flag = good;
  flag[0] = 2;
  EXPECT_FALSE(decodes(flag, out));
}

// NaN passes in every physical value; validate() and the controller judge it.
TEST(TargetLink, NansPass) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  World world, heard;
  world.sensors.gyro_B_radps[2] = kNan;
  world.sensors.accelerometer_B_mps2[0] = -std::numeric_limits<double>::infinity();
  world.sensors.orientation.coeffs()[3] = kNan;
  firmware::MoveRequest move;
  move.speed_fraction = move.target_position[7] = kNan;
  world.commands[0] = move;
  world.command_count = 1;
  ASSERT_TRUE(decodes(payload_of(world), heard));
  expect_same(heard.sensors, world.sensors);
  EXPECT_TRUE(std::isnan(heard.commands[0].move.speed_fraction));
  EXPECT_TRUE(std::isnan(heard.commands[0].move.target_position[7]));
  const auto params = std::make_unique<firmware::ControllerParams>(),
             taken = std::make_unique<firmware::ControllerParams>();
  params->control_period_s = kNan;
  ASSERT_TRUE(decodes(payload_of(*params), *taken));
  EXPECT_STREQ(firmware::validate(*taken).field, "control_period_s");
  // A motion with NaN is refused.
  const auto mass = std::make_unique<MassParams>();
  mass->initial_position = kNan;
  EXPECT_FALSE(set_mass(*mass, 0, *taken));
  mass->initial_position = 0;
  mass->piece_count = 1;
  mass->pieces[0].duration_s = kNan;
  EXPECT_FALSE(set_mass(*mass, 0, *taken));
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
    framed.resize(encode_frame(framed, type_of(Tag<M>()), 1, [&](Writer& writer) {
      for (const std::uint8_t byte : payload) writer(byte);
    }));
    Frame frame;
    ASSERT_EQ(decode_frame(framed, frame).error, FrameError::kNone);
    // An accepted message is in range, so it can be encoded again, in as many bytes.
    if (decode(frame, *out)) {
      EXPECT_EQ(frame_of(*out, 1).size(), framed.size());
    }
  }
}

TEST(TargetLink, NoiseNeverGetsThrough) {
  const std::uint64_t seed = ballast::test::random_seed();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  for_every_message([&]<class M>() { decode_noise<M>(random); });
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
