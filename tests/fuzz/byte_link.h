// The link between host and microcontroller, over bytes in memory.
//
// Input: a byte of flags, then frames. Unless kAsTheyAre is set their magic, version and checksum are made good, so
// that fuzzing gets past those; every length must still be right.
#pragma once

#include <algorithm>
#include <vector>

#include "hal/target/link.h"
#include "tests/fuzz/change_parts.h"
#include "tests/fuzz/fuzz_target.h"

namespace ballast::fuzz {

constexpr std::uint8_t kAsTheyAre = 1;
// Bits 1..7: by how many bytes the link hands out what it has; 0: all.

inline void mend_frames(std::span<std::uint8_t> bytes) {
  namespace target = hal::target;
  while (bytes.size() >= target::kHeaderSize + target::kTrailerSize) {
    target::Writer start(bytes.first(6));
    start(target::kMagic);
    start(target::kProtocolVersion);
    std::uint32_t length = 0;
    target::Reader reader(bytes.subspan(8, 4));
    reader(length);
    const std::size_t payload_end = target::kHeaderSize + std::size_t{length};
    if (length > target::kMaxPayload || payload_end + target::kTrailerSize > bytes.size()) return;
    target::Writer checksum(bytes.subspan(payload_end, target::kTrailerSize));
    checksum(target::crc32(bytes.first(payload_end)));
    bytes = bytes.subspan(payload_end + target::kTrailerSize);
  }
}

// The frames of an input, each with its payload; they end where a length is wrong.
inline std::vector<Part> frames_of(std::span<const std::uint8_t> input) {
  namespace target = hal::target;
  std::vector<Part> frames;
  std::size_t at = 1;  // after the flags
  while (input.size() - std::min(at, input.size()) >= target::kHeaderSize + target::kTrailerSize) {
    std::uint32_t length = 0;
    target::Reader reader(input.subspan(at + 8, 4));
    reader(length);
    const std::size_t size = target::kHeaderSize + std::size_t{length} + target::kTrailerSize;
    if (length > target::kMaxPayload || size > input.size() - at) break;
    frames.push_back({at, size, at + target::kHeaderSize, length});
    at += size;
  }
  return frames;
}

// A microcontroller's link that brings an input's bytes.
class ByteLink {
 public:
  explicit ByteLink(std::span<const std::uint8_t> input) {
    if (input.empty()) return;
    stride_ = input[0] >> 1;
    bytes_.assign(input.begin() + 1, input.end());
    if ((input[0] & kAsTheyAre) == 0) mend_frames(bytes_);
  }
  [[nodiscard]] const Bytes& bytes() const { return bytes_; }

  hal::Status read(std::span<std::uint8_t> in, std::size_t& count) {
    count = std::min(in.size(), bytes_.size() - at_);
    if (stride_ != 0) count = std::min(count, stride_);
    if (count == 0) return hal::Status::kPeerLost;
    std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(at_), count, in.begin());
    at_ += count;
    return hal::Status::kOk;
  }

 private:
  Bytes bytes_;
  std::size_t at_ = 0, stride_ = 0;
};

// A board with nothing but the link.
class BareMachine {
 public:
  static constexpr const char* kName = "fuzz";
  static constexpr std::uint32_t kCounterHz = 1'000'000;

  explicit BareMachine(std::span<const std::uint8_t> input) : link_(input) {}

  hal::Status read(std::span<std::uint8_t> in, std::size_t& count) { return link_.read(in, count); }
  hal::Status write(std::span<const std::uint8_t> bytes) {
    said_.insert(said_.end(), bytes.begin(), bytes.end());
    return hal::Status::kOk;
  }
  bool start(const firmware::ControllerParams&, const hal::target::Commit&) { return true; }
  std::uint32_t wait_tick() { return 1; }
  [[nodiscard]] bool tick_due() const { return false; }
  [[nodiscard]] std::uint32_t counter() const { return 0; }
  void load(const firmware::StepCommand&) {}
  void played(hal::target::PlayedPulses& pulses) const { pulses.count = 0; }
  void kick_watchdog() {}
  void report(hal::target::EndReport&) const {}

  [[nodiscard]] const Bytes& bytes() const { return link_.bytes(); }
  Bytes& said() { return said_; }

 private:
  ByteLink link_;
  Bytes said_;
};
static_assert(hal::target::Machine<BareMachine>);

}  // namespace ballast::fuzz
