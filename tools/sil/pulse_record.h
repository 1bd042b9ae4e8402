// Step counts and rates of the pulses that the motors have executed.
#pragma once

#include <array>
#include <span>

#include "sim/plant/plant.h"
#include "tools/sil/run_result.h"

namespace ballast::sil {

class PulseRecord {
 public:
  // `pulses` are those of an interval that starts at start_s. Pulses after until_s, where the physics ended, are left
  // out.
  void add(double start_s, double until_s, std::span<const sim::StepPulse> pulses);
  [[nodiscard]] const std::array<MotorRecord, sim::kMaxMasses>& motors() const { return motors_; }

 private:
  std::array<MotorRecord, sim::kMaxMasses> motors_{};
  std::array<double, sim::kMaxMasses> last_s_{};
};

}  // namespace ballast::sil
