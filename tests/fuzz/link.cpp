// The link between host and microcontroller: bytes -> frames -> messages, those of either end.
#include <memory>
#include <utility>

#include "tests/fuzz/byte_link.h"
#include "tests/fuzz/fuzz_target.h"

namespace ballast::fuzz {
namespace {

namespace target = hal::target;

// Decoded only if the frame says that it is one, and then it says what the frame's bytes say.
template <class M>
bool decoded(const target::Frame& frame, std::span<const std::uint8_t> bytes) {
  static const auto message = std::make_unique<M>();
  *message = M();
  if (!target::decode(frame, *message)) return false;
  require(frame.type == target::type_of(target::Tag<M>()), "a message is of its frame's type");
  static Bytes again(target::kMaxFrame);
  const std::size_t size = target::encode(*message, frame.tick, again);
  require(std::equal(again.begin(), again.begin() + static_cast<std::ptrdiff_t>(size), bytes.begin(), bytes.end()),
          "a message let through says what its bytes say");
  return true;
}

int decoded_by_all(const target::Frame& frame, std::span<const std::uint8_t> bytes) {
  return decoded<target::Hello>(frame, bytes) + decoded<firmware::ControllerParams>(frame, bytes) +
         decoded<target::MassParams>(frame, bytes) + decoded<target::Commit>(frame, bytes) +
         decoded<target::Verdict>(frame, bytes) + decoded<target::World>(frame, bytes) +
         decoded<target::Reply>(frame, bytes) + decoded<target::FaultReport>(frame, bytes) +
         decoded<target::EndReport>(frame, bytes);
}

}  // namespace

Bytes change_one_thing(Bytes input, std::mt19937_64& random) {
  const auto frames = frames_of(input);
  return change_one_part(std::move(input), frames, random);
}

bool take(std::span<const std::uint8_t> input) {
  BareMachine machine(input);
  const auto link = std::make_unique<target::Link<BareMachine>>(machine);
  std::span<const std::uint8_t> left = machine.bytes();
  bool through = false;
  for (;;) {
    target::Frame from_link, frame;
    const hal::Status status = link->receive(from_link);
    const target::FrameResult result = target::decode_frame(left, frame);
    require((status == hal::Status::kOk) == (result.error == target::FrameError::kNone),
            "a link brings the frames that its bytes hold");
    if (status != hal::Status::kOk) return through;
    require(
        from_link.type == frame.type && from_link.tick == frame.tick &&
            std::equal(from_link.payload.begin(), from_link.payload.end(), frame.payload.begin(), frame.payload.end()),
        "a link brings frames as they were sent");
    require(result.size <= left.size(), "a frame is inside its bytes");
    const int messages = decoded_by_all(frame, left.first(result.size));
    require(messages <= 1, "a frame is one message");
    through = through || messages == 1;
    left = left.subspan(result.size);
  }
}

}  // namespace ballast::fuzz
