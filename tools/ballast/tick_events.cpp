#include "tools/ballast/tick_events.h"

#include <climits>

#include "hal/lcm/channels.h"
#include "tools/recording/log_event.h"

namespace ballast {

std::string tick_events(const contact_t& contact, const plant_state_t& state,
                        const std::optional<controller_status_t>& status, const std::optional<trip_t>& trip,
                        std::int64_t& number) {
  std::string events;
  const auto add = [&](const char* channel, const auto& message) {
    const std::size_t before = events.size(), more = sil::event_size(channel, message);
    if (before + more > PIPE_BUF) return;
    events.resize(before + more);
    sil::write_event(&events[before], number++, state.utime, channel, message);
  };
  if (status) add(hal::kChannelControllerStatus, *status);
  if (trip) add(hal::kChannelTrip, *trip);
  add(hal::kChannelContact, contact);
  add(hal::kChannelPlantState, state);
  return events;
}

}  // namespace ballast
