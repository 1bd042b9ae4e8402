// One [[mass]] of a scenario: its rail, its motion and its motor, or its trajectory.
#pragma once

#include <optional>

#include "sim/scenario/reader.h"

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

// The most rows of a table of times, and the most points of a rail.
inline constexpr std::size_t kMaxTableEntries = 10000;

// The key `times` of a table: increasing, 2 to kMaxTableEntries of them.
std::optional<std::vector<double>> read_times(TableReader& table);

Mass read_mass(TableReader& table, const MassSurroundings& around);

}  // namespace ballast::sim
