// Plans a course: from where the robot is to a place, at rest.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/control/params.h"
#include "tools/plan/problem.h"
#include "tools/tracking/reference.h"

namespace ballast::go {

// A course that replaces a motion leaves the controller this part of GovernorParams::search_ticks for its certificate.
// A search takes a third where little is bent. The controller refuses a course that leaves it too little as late.
inline constexpr double kFirstSearch = 0.35;

struct GoPlan {
  sim::Scenario moved;  // set down where the course begins, with the motion
  firmware::ReferenceTable reference;
  double need = 0;                                  // greatest f_s / N with masses that follow exactly
  double most_need = 0;                             // the same with all that the governor allows for the motors' swing
  double goal_error_m = 0;                          // of the plan itself
  Eigen::Vector2d end_m = Eigen::Vector2d::Zero();  // where it was to end
  bool on_the_way = false;                          // it ends at a rest that the planner has chosen
};

struct GoTask {
  Eigen::Vector2d to_m = Eigen::Vector2d::Zero();
  std::vector<Eigen::Vector2d> via_m;
  std::optional<double> duration_s;  // none: chosen, so that the governor has nothing to bend
  plan::Objective objective = plan::Objective::kFriction;
  // A straight way with rests is planned up to the first of them, so that the ball sets out soon.
  bool sets_out = false;
  // A plan for the same places that came too late: the search begins with it. Null: none.
  std::shared_ptr<const GoPlan> late;
};

struct GoOutcome {
  std::optional<GoPlan> plan;
  std::string why;  // not found: what stands in the way, and the nearest that can be done where that is known
  std::optional<double> likely_s;  // not found in a given duration: a longer one that would likely do
};

// Along the places of a task.
[[nodiscard]] double way_m(const Eigen::Vector2d& start_m, const GoTask& task);

// A place that is asked for has coordinates up to this in size.
inline constexpr double kFarthestPlace_m = 1e4;
// "(0.6, 0) m"
[[nodiscard]] std::string place_text(const Eigen::Vector2d& place_m);

// Empty, or why no course can be so long, in metres or in seconds. `at`: where it begins.
[[nodiscard]] std::string beyond_one_course(const sim::Scenario& scenario, const plan::ReferencePoint& at,
                                            const GoTask& task);

// The last words of what `say` of plan_course() hears.
inline constexpr std::string_view kSearchesOn = "; searches on", kLooksForMore = "; looks for what can be done";

// A task that is beyond one course is refused at once. `scenario` and `params`: of the run. `at`: where the course
// begins. `stop` ends the search. `say` hears what was tried in vain, in words, and what is tried next.
[[nodiscard]] GoOutcome plan_course(const sim::Scenario& scenario, const firmware::ControllerParams& params,
                                    const plan::ReferencePoint& at, const GoTask& task,
                                    const std::function<bool()>& stop,
                                    const std::function<void(const std::string&)>& say);

}  // namespace ballast::go
