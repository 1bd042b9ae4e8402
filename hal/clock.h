// Control ticks. Time is the tick number: no code above this contract reads a wall clock.
#pragma once

#include <concepts>
#include <cstdint>

#include "hal/status.h"

namespace ballast::hal {

// wait_tick(tick): waits until a control tick is due and writes its number. Each tick is handed out once, in order.
//   kOk: the caller serves the tick. kEmpty: no tick is due, and this clock does not block. Any other: no tick follows.
// overruns(): ticks that were late since the start, >= 0.
template <class B>
concept Clock = requires(B& board, const B& const_board, std::int64_t& tick) {
  { board.wait_tick(tick) } -> std::same_as<Status>;
  { const_board.overruns() } -> std::same_as<std::int64_t>;
};

}  // namespace ballast::hal
