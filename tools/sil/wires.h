// The wires between the plant and its controller: sensors pass on one end, step commands on the other.
#pragma once

#include <cstdint>
#include <optional>

#include "hal/host_link.h"
#include "hal/lcm/messages.h"

namespace ballast::sil {

// Passes everything on unchanged. A subclass may change what passes.
class Wires {
 public:
  virtual ~Wires() = default;
  // Called once per tick, from the countdown on, before anybody hears the sensors.
  virtual void carry_sensors(double /*time_s*/, sensors_t& /*sensors*/) {}
  // Called once per tick with the controller's step command, null if there is none. Returns the command that reaches
  // the motors, null if none does; it is valid until the next call.
  virtual const step_command_t* carry_steps(std::int64_t /*tick*/, const step_command_t* steps) { return steps; }
  // Messages that arrived and were not used.
  [[nodiscard]] virtual hal::LinkCounters refused() const { return {}; }
};

}  // namespace ballast::sil
