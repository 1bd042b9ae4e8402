#include "tools/sil/pulse_record.h"

#include <algorithm>

namespace ballast::sil {

void PulseRecord::add(double start_s, double until_s, std::span<const sim::StepPulse> pulses) {
  for (const auto& pulse : pulses) {
    const double time_s = start_s + pulse.offset_s;
    if (time_s > until_s) break;
    const auto i = static_cast<std::size_t>(pulse.motor);
    MotorRecord& motor = motors_[i];
    if (motor.steps++ > 0) motor.max_step_rate_hz = std::max(motor.max_step_rate_hz, 1 / (time_s - last_s_[i]));
    last_s_[i] = time_s;
  }
}

}  // namespace ballast::sil
