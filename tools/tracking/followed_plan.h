// The plan that a run follows: the reference and gains of its controller, and the path that its plan says.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "firmware/model/ball.h"
#include "firmware/tracking/reference.h"
#include "sim/scenario/scenario.h"

namespace ballast::plan {

// The scenario in which its plan is true: as it believes the robot, set down where [plan] says, without faults.
[[nodiscard]] sim::Scenario as_planned(const sim::Scenario& scenario);

// Duration of the longest of the masses' motions.
[[nodiscard]] double motion_end_s(const sim::Scenario& scenario);

// Computes reference and gains of the controller from motion and belief; `ball` is that of the belief. Nullopt, or why
// there are none; `table` is then unchanged. A thread keeps its last result, for rows of a sweep that believe the same.
[[nodiscard]] std::optional<std::string> set_reference(const sim::Scenario& scenario, const firmware::BallParams& ball,
                                                       firmware::ReferenceTable& table);

// Places of the geometric centre that the plan says, at equal times from 0 on, with the velocities there.
struct PlannedPath {
  double step_s = 0;
  std::vector<Eigen::Vector2d> place_W_m, velocity_W_mps;

  // Between places a cubic; after the end the last place.
  [[nodiscard]] Eigen::Vector2d place_at(double time_s) const;
  // To the nearest point of the polyline through the places.
  [[nodiscard]] double distance_m(const Eigen::Vector2d& place_W_m) const;
  [[nodiscard]] double length_m() const;
};

// None where the plan does not roll.
[[nodiscard]] std::optional<PlannedPath> planned_path(const sim::Scenario& scenario);

}  // namespace ballast::plan
