// What a run's ball was made of, for whoever draws it: robot.json beside the log.
#pragma once

#include <string>

#include "sim/scenario/scenario.h"

namespace ballast::sil {

// {"gravity": m/s^2, "ball": {"radius": m, "mass": kg, "center_of_mass": [m, body frame]},
//  "masses": [{"mass": kg, "rail": {"shape": "circle" | "line" | "spline", "closed": bool, "points": [[m, body
//  frame]]}}]}
// of the scenario as it ran, overrides and defaults applied. `points` lie along the rail near enough to each other to
// be joined by straight lines; a line or an open spline goes from end stop to end stop, where it has none a line to the
// shell and a spline to its last knots. `rail` is null for a mass on a trajectory, whose curve is
// in the log.
std::string robot_json(const sim::Scenario& scenario);

}  // namespace ballast::sil
