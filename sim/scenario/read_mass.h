// One [[mass]] of a scenario: its rail, its motion and its motor, or its trajectory.
#pragma once

#include <optional>

#include "sim/scenario/reader.h"

namespace ballast::sim {

// The parts of the scenario that a mass is checked against. nullopt: missing or wrong, which has been reported.
struct MassSurroundings {
  std::optional<double> duration_s;
  std::optional<double> gravity_mps2;
  std::optional<double> ball_radius_m;
  std::optional<double> control_period_s;
  std::optional<double> timer_frequency_hz;
  std::optional<Actuation> actuation;
  bool governor = false;
  int mass_count = 1;
};

// Limit for rows of a table and points of a rail.
inline constexpr std::size_t kMaxTableEntries = 10000;

// Reads the key `times` of a table: 2 to kMaxTableEntries increasing numbers.
std::optional<std::vector<double>> read_times(TableReader& table);

Mass read_mass(TableReader& table, const MassSurroundings& around);

}  // namespace ballast::sim
