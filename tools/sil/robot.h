// robot.json: the geometry of a run's ball, beside the log, for programs that draw it.
#pragma once

#include <string>

#include "sim/scenario/scenario.h"

namespace ballast::sil {

// {"gravity": m/s^2, "ball": {"radius": m, "mass": kg, "center_of_mass": [m, body frame]},
//  "masses": [{"mass": kg, "rail": {"shape": "circle" | "line" | "spline", "closed": bool, "points": [[m, body
//  frame]]}}]}
// The scenario is taken as it ran, overrides and defaults applied. `points` lie along the rail, close enough to be
// joined by straight lines. A line or an open spline goes from end stop to end stop; without end stops a line ends at
// the shell and a spline at its last knots. `rail` is null for a mass on a trajectory: its curve is in the log.
std::string robot_json(const sim::Scenario& scenario);

}  // namespace ballast::sil
