// One [[mass]] of a scenario: its rail, its motion, its motor.
#pragma once

#include <optional>

#include "sim/scenario_reader.h"

namespace ballast::sim {

// What of the rest of the scenario a mass is checked against; nothing where that is missing or faulty itself.
struct MassSurroundings {
  std::optional<double> duration_s;
  std::optional<double> gravity_mps2;
  std::optional<double> ball_radius_m;
  std::optional<double> control_period_s;
  std::optional<double> timer_frequency_hz;
  std::optional<Actuation> actuation;
};

Mass read_mass(TableReader& table, const MassSurroundings& around);

}  // namespace ballast::sim
