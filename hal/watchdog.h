// Cuts the motors' power unless it is kicked once per control tick.
#pragma once

#include <concepts>

namespace ballast::hal {

// kick_watchdog(): the tick is served, its outputs are written.
template <class B>
concept Watchdog = requires(B& board) {
  { board.kick_watchdog() } -> std::same_as<void>;
};

}  // namespace ballast::hal
