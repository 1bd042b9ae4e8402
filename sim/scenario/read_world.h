// The tables [ball] and [surface] of a scenario.
#pragma once

#include <optional>

#include "sim/plant/world.h"
#include "sim/scenario/reader.h"

namespace ballast::sim {

// `radius`: nullopt if it is missing or wrong, which has been reported.
void read_ball(TableReader table, std::optional<double>& radius, Ball& ball);
// Refuse an inertia that no body has, and a centre of mass outside the ball.
void check_inertia(TableReader& table, const Ball& ball);
void check_center(TableReader& table, const Ball& ball);

// Keys that are missing keep what `surface` has.
void read_surface(TableReader table, Surface& surface);
void read_slope(TableReader table, Surface& surface);

}  // namespace ballast::sim
