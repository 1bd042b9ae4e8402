#include "sim/motors/motor_presets.h"

#include <algorithm>

namespace ballast::sim {

namespace {

// Trinamic's (now Analog Devices') QMOT manuals state currents as rms and heat as 2 I^2 R, as phase_current.h does.
constexpr MotorPreset kPresets[] = {
    {.name = "nema11",
     .source = "Trinamic QSH2818-51-07-012, QMOT QSH2818 manual V1.07, table 1 (28 x 28 x 51 mm, 0.2 kg)",
     .steps_per_revolution = 200,
     .holding_torque_nm = 0.12,
     .detent_torque_nm = 0,
     .rotor_inertia_kgm2 = 18e-7,
     .rated_current_a = 0.67,
     .resistance_ohm = 9.2,
     .inductance_h = 7.2e-3,
     .supply_voltage_v = 24},
    {.name = "nema17",
     .source = "Trinamic QSH4218-41-10-035, QMOT QSH4218 manual V1.10, table 2.1 (42 x 42 x 40 mm, 0.28 kg)",
     .steps_per_revolution = 200,
     .holding_torque_nm = 0.35,
     .detent_torque_nm = 0.025,
     .rotor_inertia_kgm2 = 54e-7,
     .rated_current_a = 1.0,
     .resistance_ohm = 4.5,
     .inductance_h = 7.5e-3,
     .supply_voltage_v = 24},
    {.name = "nema23",
     .source = "Trinamic QSH5718-56-28-126, QMOT QSH5718 manual V2.6, table 2.1 (57 x 57 x 56 mm, 0.7 kg)",
     .steps_per_revolution = 200,
     .holding_torque_nm = 1.26,
     .detent_torque_nm = 0.039,
     .rotor_inertia_kgm2 = 300e-7,
     .rated_current_a = 2.8,
     .resistance_ohm = 0.9,
     .inductance_h = 2.5e-3,
     .supply_voltage_v = 30},
};

}  // namespace

std::span<const MotorPreset> motor_presets() { return kPresets; }

const MotorPreset* find_motor_preset(std::string_view name) {
  const auto* found =
      std::find_if(std::begin(kPresets), std::end(kPresets), [&](const auto& p) { return p.name == name; });
  return found == std::end(kPresets) ? nullptr : found;
}

}  // namespace ballast::sim
