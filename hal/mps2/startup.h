// Start of the program, from reset to main(), and its exit statuses.
#pragma once

#include <cstdint>

#include "hal/status.h"

namespace ballast::hal::mps2 {

// Exit status of the emulator.
enum class Exit : std::uint32_t {
  kEnded = 0,
  kNoLink = 10,  // the link could not be opened
  kLinkCut = 11,
  kLinkGarbled = 12,
  kRefused = 13,  // the parameters were refused
  kFault = 14,
  kWatchdog = 15,
};

// The exit status for the result of target::serve().
constexpr int exit_of(Status status) {
  switch (status) {
    case Status::kEnded:
      return static_cast<int>(Exit::kEnded);
    case Status::kEmpty:
      return static_cast<int>(Exit::kRefused);
    case Status::kIo:
      return static_cast<int>(Exit::kLinkGarbled);
    default:
      return static_cast<int>(Exit::kLinkCut);
  }
}

[[nodiscard]] std::uint32_t stack_bytes();       // reserved
[[nodiscard]] std::uint32_t stack_used_bytes();  // written at least once, by the paint that is left

}  // namespace ballast::hal::mps2
