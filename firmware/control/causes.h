// Judges the inputs of a control tick: what in them is a fault.
#pragma once

#include "firmware/control/inputs.h"
#include "firmware/control/params.h"
#include "firmware/control/state.h"

namespace ballast::firmware {

// How a tick follows the one before.
enum class Order : std::uint8_t { kInOrder, kRepeated, kBroken };

[[nodiscard]] Order order_of(const ControllerState& state, std::int64_t tick);

// True if the attitude has about unit length, and it and the rates and accelerations are finite.
[[nodiscard]] bool valid(const Sensors& sensors);

// Returns the sensed attitude with unit length. `sensors` are valid.
[[nodiscard]] Quaternion attitude(const Sensors& sensors);

// Returns the bits of the world's faults that are present in this tick. state.now is the commanded motion.
[[nodiscard]] std::uint32_t causes_of(const ControllerParams& params, const ControllerState& state,
                                      const Inputs& inputs, Order order);

}  // namespace ballast::firmware
