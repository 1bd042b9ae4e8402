// The least margin that was seen of a ball, over some ticks.
#pragma once

#include <algorithm>
#include <ballast/contact_t.hpp>
#include <optional>

namespace ballast::sil {

// In the air there is no margin; but to leave the ground, between two ticks too, is the worst there is: -1, as in the
// firmware's prediction. Until the ball has been seen on the ground nothing is known.
inline void see_margin(const contact_t& contact, std::optional<double>& least) {
  const bool in_flight = contact.regime == contact_t::REGIME_FLIGHT;
  if (!least) {
    if (!in_flight) least = contact.margin;
  } else {
    least = std::min(*least, in_flight || contact.normal_force_min_n <= 0 ? -1 : contact.margin);
  }
}

}  // namespace ballast::sil
