// The scenario's faults of the sensors, and of the step commands on their way to the motors.
#pragma once

#include <optional>

#include "tools/faults/faulty_links.h"
#include "tools/faults/sensor_faults.h"
#include "tools/sil/wires.h"

namespace ballast::sil {

class FaultyWires final : public Wires {
 public:
  // The scenario must outlive the wires.
  explicit FaultyWires(const sim::Scenario& scenario);

  void carry_sensors(double time_s, sensors_t& sensors) override { sensor_faults_.apply(time_s, sensors); }
  const step_command_t* carry_steps(std::int64_t tick, const step_command_t* steps) override;
  [[nodiscard]] hal::LinkCounters refused() const override;

 private:
  SensorFaults sensor_faults_;
  std::optional<MotorLink> motor_link_;  // none: the scenario has no faults that act on it
  std::optional<step_command_t> delivered_;
};

}  // namespace ballast::sil
