// scenario_piece_t, which tells observers of a bus the run's scenario. No controller and no monitor takes it.
#pragma once

#include <ballast/scenario_piece_t.hpp>

namespace ballast {

namespace hal {
inline constexpr char kChannelScenario[] = "BALLAST_SCENARIO";
}

// As the in_range() of hal/lcm/messages.h. It stands beside the type, where hal::decode() finds it.
inline bool in_range(const scenario_piece_t& message) {
  return message.pieces >= 1 && message.pieces <= scenario_piece_t::MOST_PIECES && message.piece >= 0 &&
         message.piece < message.pieces && message.size >= 1 && message.size <= scenario_piece_t::MOST_SIZE;
}

}  // namespace ballast
