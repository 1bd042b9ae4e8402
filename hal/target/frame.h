// What goes over the link between a host and a microcontroller: frames. The decoder is a function from bytes to a
// frame, without state, for any bytes.
//
//   offset  size
//        0     4  0x54534c42, "BLST"
//        4     2  kProtocolVersion
//        6     2  MessageType
//        8     4  length of the payload, at most kMaxPayload
//       12     8  control tick the message is about; 0 where it is about none
//       20     n  payload: messages.h
//   20 + n     4  CRC-32 of all bytes before it
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/target/wire.h"

namespace ballast::hal::target {

inline constexpr std::uint32_t kMagic = 0x54534c42;
inline constexpr std::uint16_t kProtocolVersion = 2;
inline constexpr std::size_t kHeaderSize = 20;
inline constexpr std::size_t kTrailerSize = 4;
inline constexpr std::size_t kMaxPayload = 8192;
inline constexpr std::size_t kMaxFrame = kHeaderSize + kMaxPayload + kTrailerSize;

enum class MessageType : std::uint16_t {
  kHello = 1,      // target: what it is
  kBall = 2,       // host: parameters, without the masses
  kMass = 3,       // host: parameters of one mass, in order
  kCommit = 4,     // host: that was all
  kVerdict = 5,    // target: parameters accepted, or why not
  kWorld = 6,      // host: what the controller hears in one tick
  kReply = 7,      // target: what the controller says to it
  kLastWords = 8,  // target: it cannot go on, and why
  kFarewell = 9,   // target: the last tick is served
};

struct Frame {
  MessageType type = MessageType::kHello;
  std::int64_t tick = 0;
  std::span<const std::uint8_t> payload;  // inside the bytes decoded
};

enum class FrameError : std::uint8_t {
  kNone,
  kIncomplete,  // the beginning of a frame; `needed` says how many bytes are needed to know more
  kNotAFrame,   // no magic
  kVersion,     // another version of the protocol
  kType,        // no such message
  kLength,      // longer than any message
  kChecksum,
};

struct FrameResult {
  FrameError error = FrameError::kNone;
  std::size_t size = 0;    // kNone: of the frame
  std::size_t needed = 0;  // kIncomplete: bytes in all
};

// The frame at the beginning of `bytes`. On failure `frame` is untouched.
[[nodiscard]] inline FrameResult decode_frame(std::span<const std::uint8_t> bytes, Frame& frame) {
  if (bytes.size() < kHeaderSize) return {FrameError::kIncomplete, 0, kHeaderSize};
  Reader reader(bytes.first(kHeaderSize));
  std::uint32_t magic = 0, length = 0;
  std::uint16_t version = 0, type = 0;
  std::int64_t tick = 0;
  reader(magic);
  reader(version);
  reader(type);
  reader(length);
  reader(tick);
  if (magic != kMagic) return {FrameError::kNotAFrame, 0, 0};
  if (version != kProtocolVersion) return {FrameError::kVersion, 0, 0};
  if (type < static_cast<std::uint16_t>(MessageType::kHello) ||
      type > static_cast<std::uint16_t>(MessageType::kFarewell)) {
    return {FrameError::kType, 0, 0};
  }
  if (length > kMaxPayload) return {FrameError::kLength, 0, 0};
  const std::size_t size = kHeaderSize + length + kTrailerSize;
  if (bytes.size() < size) return {FrameError::kIncomplete, 0, size};
  std::uint32_t crc = 0;
  Reader trailer(bytes.subspan(size - kTrailerSize, kTrailerSize));
  trailer(crc);
  if (crc != crc32(bytes.first(size - kTrailerSize))) return {FrameError::kChecksum, 0, 0};
  frame.type = static_cast<MessageType>(type);
  frame.tick = tick;
  frame.payload = bytes.subspan(kHeaderSize, length);
  return {FrameError::kNone, size, 0};
}

// Writes a frame around what `payload(Writer&)` writes; 0: it does not fit.
template <class Payload>
[[nodiscard]] std::size_t encode_frame(std::span<std::uint8_t> bytes, MessageType type, std::int64_t tick,
                                       const Payload& payload) {
  if (bytes.size() < kHeaderSize + kTrailerSize) return 0;
  Writer body(bytes.subspan(kHeaderSize, bytes.size() - kHeaderSize - kTrailerSize));
  payload(body);
  if (!body.ok() || body.size() > kMaxPayload) return 0;
  Writer header(bytes.first(kHeaderSize));
  header(kMagic);
  header(kProtocolVersion);
  header(type);
  header(static_cast<std::uint32_t>(body.size()));
  header(tick);
  const std::size_t size = kHeaderSize + body.size();
  Writer trailer(bytes.subspan(size, kTrailerSize));
  trailer(crc32(bytes.first(size)));
  return size + kTrailerSize;
}

}  // namespace ballast::hal::target
