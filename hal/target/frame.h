// Frames of the link between a host and a microcontroller. decode_frame() is a function of bytes alone and accepts any;
// FrameStream finds the frames in a stream that comes in pieces.
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

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
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
  kHello = 1,        // target: its identity
  kBall = 2,         // host: parameters without the masses
  kMass = 3,         // host: parameters of one mass, in order
  kCommit = 4,       // host: the parameters are complete
  kVerdict = 5,      // target: parameters accepted or refused, with the reason
  kWorld = 6,        // host: the controller's inputs of one tick
  kReply = 7,        // target: the controller's outputs of that tick
  kFaultReport = 8,  // target: it cannot continue, with the reason
  kEndReport = 9,    // target: the last tick was served
  kReference = 10,   // host: values of the reference to be tracked, in parts
};

struct Frame {
  MessageType type = MessageType::kHello;
  std::int64_t tick = 0;
  std::span<const std::uint8_t> payload;  // inside the bytes decoded
};

enum class FrameError : std::uint8_t {
  kNone,
  kIncomplete,  // a frame begins here; FrameResult::needed bytes are needed to know more
  kNotAFrame,   // not the magic number
  kVersion,     // another version of the protocol
  kType,        // unknown message type
  kLength,      // longer than any message
  kChecksum,
};

struct FrameResult {
  FrameError error = FrameError::kNone;
  std::size_t size = 0;    // of the frame, with kNone
  std::size_t needed = 0;  // in all, with kIncomplete
};

// Decodes the frame at the beginning of `bytes`. On failure `frame` is untouched.
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
      type > static_cast<std::uint16_t>(MessageType::kReference)) {
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

// Writes a frame around the bytes that `payload(Writer&)` writes, and returns its size. 0: it does not fit.
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

// Finds frames in a stream of bytes that comes in pieces of any size. Bytes that are no frame end the stream, because
// the bytes after them could be an old frame.
class FrameStream {
 public:
  // The next frame, with a payload that is good until the next call, or why there is none. kIncomplete: more bytes are
  // needed.
  FrameError next(Frame& frame) {
    begin_ += taken_;
    taken_ = 0;
    const FrameResult result = decode_frame(std::span(bytes_).first(end_).subspan(begin_), frame);
    if (result.error == FrameError::kNone) taken_ = result.size;
    return result.error;
  }

  // Free space for the bytes that come next: at least one byte after kIncomplete. added() says how many came.
  [[nodiscard]] std::span<std::uint8_t> space() {
    if (begin_ == end_) begin_ = end_ = 0;  // the usual case: one read brings one frame, and nothing is moved
    if (bytes_.size() - begin_ < kMaxFrame) {
      std::memmove(bytes_.data(), bytes_.data() + begin_, end_ - begin_);
      end_ -= begin_;
      begin_ = 0;
    }
    return std::span(bytes_).subspan(end_);
  }
  void added(std::size_t count) { end_ += count; }

 private:
  std::array<std::uint8_t, 2 * kMaxFrame> bytes_;
  std::size_t begin_ = 0, end_ = 0;  // of the bytes that came and are not yet used
  std::size_t taken_ = 0;            // by the frame handed out
};

}  // namespace ballast::hal::target
