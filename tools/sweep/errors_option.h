// --errors: a sweep of a scenario with the errors of a robot that was built.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/sweep/spec.h"

namespace ballast::sweep {

// The kinds of errors and their units, for messages and the help.
[[nodiscard]] std::string errors_allowed();

// "mass=5%,com=0.5%,tilt=3deg": standard deviations of normal errors.
//   mass, inertia, friction, torque   % of the nominal value, each mass (inertia, motor) for itself
//   com                               % of the radius, along each axis
//   tilt                              deg or rad, of the initial attitude about each of two horizontal axes
// nullopt: `errors` says why not.
[[nodiscard]] std::optional<Spec> errors_sweep(const std::string& scenario_file, const std::string& errors_text,
                                               std::uint64_t runs, std::uint64_t seed,
                                               std::vector<sim::ScenarioError>& errors);

}  // namespace ballast::sweep
