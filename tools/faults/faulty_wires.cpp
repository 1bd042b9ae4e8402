#include "tools/faults/faulty_wires.h"

namespace ballast::sil {

FaultyWires::FaultyWires(const sim::Scenario& scenario) : sensor_faults_(scenario) {
  if (has_link_faults(scenario)) motor_link_.emplace(scenario);
}

const step_command_t* FaultyWires::carry_steps(std::int64_t tick, const step_command_t* steps) {
  if (!motor_link_) return steps;
  delivered_ = motor_link_->deliver(tick, steps);
  return delivered_ ? &*delivered_ : nullptr;
}

hal::LinkCounters FaultyWires::refused() const { return motor_link_ ? motor_link_->counters() : hal::LinkCounters(); }

}  // namespace ballast::sil
