// The least margin of a ball over some ticks.
#pragma once

#include <algorithm>
#include <ballast/contact_t.hpp>
#include <optional>

namespace ballast::sil {

// Lowers `least` to this message's margin. A ball in the air has no margin, but leaving the ground, between two ticks
// too, counts as -1, as in the firmware's prediction. `least` stays empty until the ball has been on the ground.
inline void lower_margin(const contact_t& contact, std::optional<double>& least) {
  const bool in_flight = contact.regime == contact_t::REGIME_FLIGHT;
  if (!least) {
    if (!in_flight) least = contact.margin;
  } else {
    least = std::min(*least, in_flight || contact.normal_force_min_n <= 0 ? -1 : contact.margin);
  }
}

}  // namespace ballast::sil
