// Frames over a machine's byte stream.
#pragma once

#include <array>

#include "hal/target/machine.h"

namespace ballast::hal::target {

template <Machine M>
class Link {
 public:
  explicit Link(M& machine) : machine_(machine) {}

  // Waits for a frame, whose payload is good until the next call. kIo: bytes came that are none; nothing after them can
  // be trusted.
  Status receive(Frame& frame) {
    // Usually one read brings one frame, and nothing has to be moved.
    begin_ += taken_;
    taken_ = 0;
    if (begin_ == end_) begin_ = end_ = 0;
    for (;;) {
      const std::span<const std::uint8_t> bytes(received_.data() + begin_, end_ - begin_);
      const FrameResult result = decode_frame(bytes, frame);
      if (result.error == FrameError::kNone) {
        taken_ = result.size;
        return Status::kOk;
      }
      if (result.error != FrameError::kIncomplete) return Status::kIo;
      if (received_.size() - begin_ < kMaxFrame) {
        std::memmove(received_.data(), received_.data() + begin_, end_ - begin_);
        end_ -= begin_;
        begin_ = 0;
      }
      std::size_t count = 0;
      if (const Status s = machine_.read(std::span(received_).subspan(end_), count); s != Status::kOk) return s;
      end_ += count;
    }
  }

  template <Message T>
  Status send(const T& message, std::int64_t tick) {
    const std::size_t size = encode(message, tick, sent_);
    if (size == 0) return Status::kIo;
    return machine_.write(std::span<const std::uint8_t>(sent_).first(size));
  }

 private:
  M& machine_;
  std::array<std::uint8_t, 2 * kMaxFrame> received_;
  std::array<std::uint8_t, kMaxFrame> sent_;
  std::size_t begin_ = 0, end_ = 0;  // of what has come and is not yet used
  std::size_t taken_ = 0;            // of that, by the frame handed out
};

}  // namespace ballast::hal::target
