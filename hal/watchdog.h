// The watchdog cuts the motors' power unless it is kicked in every control tick.
#pragma once

#include <concepts>

namespace ballast::hal {

// kick_watchdog(): called once per tick, after its outputs were written.
template <class B>
concept Watchdog = requires(B& board) {
  { board.kick_watchdog() } -> std::same_as<void>;
};

}  // namespace ballast::hal
