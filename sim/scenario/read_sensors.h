// The table [sensors] of a scenario.
#pragma once

#include "sim/scenario/reader.h"
#include "sim/sensors/sensor_model.h"

namespace ballast::sim {

// control_period_s: nullopt if it is wrong, which has been reported.
SensorModel read_sensors(TableReader table, std::optional<double> control_period_s, int mass_count);

}  // namespace ballast::sim
