// Messages over a machine's byte stream. Used by the control loop only, never by an interrupt.
#pragma once

#include <array>

#include "hal/target/machine.h"

namespace ballast::hal::target {

template <Machine M>
class Link {
 public:
  explicit Link(M& machine) : machine_(machine) {}

  // Waits for a frame; its payload is good until the next call. kIo: the bytes are no frame, and the link has ended.
  Status receive(Frame& frame) {
    for (;;) {
      const FrameError error = frames_.next(frame);
      if (error == FrameError::kNone) return Status::kOk;
      if (error != FrameError::kIncomplete) return Status::kIo;
      std::size_t count = 0;
      if (const Status s = machine_.read(frames_.space(), count); s != Status::kOk) return s;
      frames_.added(count);
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
  FrameStream frames_;
  std::array<std::uint8_t, kMaxFrame> sent_;
};

}  // namespace ballast::hal::target
