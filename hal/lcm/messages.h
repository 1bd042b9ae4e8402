// Conversions between the firmware's structs, the LCM messages and their bytes. The fields are those of hal/messages.h.
#pragma once

#include <ballast/contact_t.hpp>
#include <ballast/controller_status_t.hpp>
#include <ballast/operator_t.hpp>
#include <ballast/plant_state_t.hpp>
#include <ballast/sensors_t.hpp>
#include <ballast/step_command_t.hpp>
#include <ballast/trip_t.hpp>
#include <cstddef>
#include <cstdint>

#include "firmware/control/inputs.h"
#include "firmware/control/status.h"

namespace ballast::hal {

// us at the start of a control tick, rounded.
std::int64_t tick_utime(std::int64_t tick, double control_period_s);

// The arguments determine every byte of the message; array entries beyond a count are 0. Numbers keep their bits.
// run_id and the fields that only the sender knows (refused_messages, sender) are 0.
sensors_t to_message(const firmware::Sensors& sensors, int mass_count, bool last, std::int64_t scenario_id,
                     double control_period_s);
step_command_t to_message(const firmware::StepCommand& steps, double control_period_s);
controller_status_t to_message(const firmware::ControllerStatus& status, double control_period_s);
operator_t to_message(const firmware::OperatorInput& input, std::int64_t tick, std::int64_t sequence,
                      double control_period_s);

// The message must satisfy in_range().
firmware::Sensors from_message(const sensors_t& message);
firmware::StepCommand from_message(const step_command_t& message);
firmware::ControllerStatus from_message(const controller_status_t& message);  // `predicted` gets N and f_s only
firmware::MonitorVerdict from_message(const trip_t& message);
firmware::OperatorInput from_message(const operator_t& message);

// True if counts, indices, flags and enumerations are inside what the .lcm files state, and ticks are at most
// kFarthestTick from 0, so that their differences do not overflow. Physical values are not judged: NaN passes.
bool in_range(const contact_t& message);
bool in_range(const plant_state_t& message);
bool in_range(const sensors_t& message);
bool in_range(const step_command_t& message);
bool in_range(const controller_status_t& message);
bool in_range(const trip_t& message);
bool in_range(const operator_t& message);

// True if the first 8 bytes are the type's hash, big-endian as LCM writes it. Reads at most `size` bytes.
bool has_hash(const void* data, std::size_t size, std::int64_t hash);

// Decodes bytes from anywhere. False, and `message` untouched, unless they are exactly one message of this type and in
// range. Size and hash are checked before anything is decoded.
template <class M>
[[nodiscard]] bool decode(const void* data, std::size_t size, M& message) {
  M decoded{};
  if (size != static_cast<std::size_t>(decoded.getEncodedSize()) || !has_hash(data, size, M::getHash())) return false;
  if (decoded.decode(data, 0, static_cast<int>(size)) != static_cast<int>(size) || !in_range(decoded)) return false;
  message = decoded;
  return true;
}

}  // namespace ballast::hal
