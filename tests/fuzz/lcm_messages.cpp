// The seven LCM types: bytes -> message -> firmware's structs and back, and the operators' inbox.
//
// Input: one message after the other, each a byte that says of which type and whether what follows is
// - as it is, to the end of the input (kRaw), or
// - of that type's length (zeros where the input ends) and with its fingerprint, so that fuzzing gets past those two.
#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "hal/lcm/messages.h"
#include "hal/lcm/operator_inbox.h"
#include "tests/fuzz/change_parts.h"

namespace ballast::fuzz {
namespace {

constexpr std::uint8_t kRaw = 0x80;
constexpr double kPeriod_s = 0.001;

template <class M>
std::vector<std::uint8_t> encoded(const M& message) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

template <class M>
std::vector<std::uint8_t> through_firmware(const M& message) {
  if constexpr (std::is_same_v<M, sensors_t>) {
    return encoded(hal::to_message(hal::from_message(message), message.mass_count, message.last == 1,
                                   message.scenario_id, kPeriod_s));
  } else if constexpr (std::is_same_v<M, operator_t>) {
    return encoded(hal::to_message(hal::from_message(message), message.tick, message.sequence, kPeriod_s));
  } else {
    return encoded(hal::to_message(hal::from_message(message), kPeriod_s));
  }
}

// No command but a stop comes out twice, or after a newer one of its sender. That is promised as long as there are few
// senders; many invented ones push old ones out of the memory.
class Inbox {
 public:
  void hear(const operator_t& message) {
    inbox_.hear(message);
    newest_.try_emplace(message.sender);
  }
  void empty() {
    while (const auto message = inbox_.next()) {
      auto& newest = newest_[message->sender];
      if (message->command == operator_t::COMMAND_STOP || newest_.size() > 32) continue;
      require(!newest || message->sequence > *newest, "a command comes out once and in order");
      newest = message->sequence;
    }
  }

 private:
  hal::OperatorInbox inbox_;
  std::map<std::int64_t, std::optional<std::int64_t>> newest_;
};

class Messages {
 public:
  explicit Messages(std::span<const std::uint8_t> input) : left_(input) {}

  bool take() {
    while (!left_.empty()) {
      const std::uint8_t type = left_[0];
      left_ = left_.subspan(1);
      switch ((type & ~kRaw) % 7) {
        case 0:
          take<contact_t>(type);
          break;
        case 1:
          take<plant_state_t>(type);
          break;
        case 2:
          take<sensors_t>(type);
          break;
        case 3:
          take<step_command_t>(type);
          break;
        case 4:
          take<controller_status_t>(type);
          break;
        case 5:
          take<trip_t>(type);
          break;
        default:
          take<operator_t>(type);
      }
    }
    inbox_.empty();
    return through_;
  }

 private:
  template <class M>
  void take(std::uint8_t type) {
    M message{};
    message.tick = kUntouched;
    std::vector<std::uint8_t> bytes(left_.begin(), left_.end());
    if ((type & kRaw) == 0) {
      bytes.resize(static_cast<std::size_t>(message.getEncodedSize()));
      for (int i = 0; i < 8; ++i)
        bytes[i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(M::getHash()) >> (56 - 8 * i));
    }
    left_ = left_.subspan(std::min(left_.size(), bytes.size()));
    if (!hal::decode(bytes.data(), bytes.size(), message)) {
      require(message.tick == kUntouched, "a message refused leaves what was there");
      return;
    }
    through_ = true;
    require(hal::in_range(message), "a message let through is in range");
    require(encoded(message) == bytes, "a message let through says what its bytes say");
    use(message);
  }

  template <class M>
  void use(const M& message) {
    if constexpr (std::is_same_v<M, trip_t>) {
      require(hal::from_message(message).tick == message.tick, "a verdict keeps its tick");
    } else if constexpr (!std::is_same_v<M, contact_t> && !std::is_same_v<M, plant_state_t>) {
      const std::vector<std::uint8_t> once = through_firmware(message);
      M again{};
      require(hal::decode(once.data(), once.size(), again), "what the firmware's struct says can be said again");
      require(through_firmware(again) == once, "and is then the same");
    }
    if constexpr (std::is_same_v<M, operator_t>) {
      inbox_.hear(message);
      if (message.tick % 2 != 0) inbox_.empty();
    }
  }

  static constexpr std::int64_t kUntouched = 4711;
  std::span<const std::uint8_t> left_;
  Inbox inbox_;
  bool through_ = false;
};

// The lengths of the seven types, by the number that the input calls them.
std::size_t length_of(std::uint8_t type) {
  const int lengths[] = {contact_t().getEncodedSize(),           plant_state_t().getEncodedSize(),
                         sensors_t().getEncodedSize(),           step_command_t().getEncodedSize(),
                         controller_status_t().getEncodedSize(), trip_t().getEncodedSize(),
                         operator_t().getEncodedSize()};
  return static_cast<std::size_t>(lengths[(type & ~kRaw) % 7]);
}

std::vector<Part> messages_of(std::span<const std::uint8_t> input) {
  constexpr std::size_t kFingerprint = 8;
  std::vector<Part> messages;
  for (std::size_t at = 0; at < input.size() && (input[at] & kRaw) == 0;) {
    const std::size_t size = std::min(1 + length_of(input[at]), input.size() - at);
    if (size <= 1 + kFingerprint) break;
    messages.push_back({at, size, at + 1 + kFingerprint, size - 1 - kFingerprint});
    at += size;
  }
  return messages;
}

}  // namespace

Bytes change_one_thing(Bytes input, std::mt19937_64& random) {
  const auto messages = messages_of(input);
  return change_one_part(std::move(input), messages, random);
}

bool take(std::span<const std::uint8_t> input) { return Messages(input).take(); }

}  // namespace ballast::fuzz
