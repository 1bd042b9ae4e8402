// Motors one can buy, by the name of their class: the values of `preset` in a scenario's [mass.motor].
#pragma once

#include <span>
#include <string_view>

namespace ballast::sim {

// Figures as the datasheet prints them, in SI. Each is the default of the motor key it is named after.
struct MotorPreset {
  std::string_view name;
  std::string_view source;
  int steps_per_revolution;
  double holding_torque_nm;
  double detent_torque_nm;  // 0: not printed
  double rotor_inertia_kgm2;
  double rated_current_a;
  double resistance_ohm;
  double inductance_h;
  double supply_voltage_v;  // the driver's, for which the datasheet draws its torque curves
};

std::span<const MotorPreset> motor_presets();

// nullptr: no such preset.
const MotorPreset* find_motor_preset(std::string_view name);

}  // namespace ballast::sim
