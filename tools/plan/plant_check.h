// The plant's run of a motion: the judge of every plan.
#pragma once

#include <functional>

#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"
#include "tools/plan/rollout.h"

namespace ballast::plan {

// The scenario with the motion of `knots`, its masses prescribed and its duration the motion's.
[[nodiscard]] sim::Scenario with_motion(const sim::Scenario& scenario, const Grid& grid,
                                        const std::vector<double>& knots);

// The motion of each mass, made to last for duration_s; over the same way, if the masses start at rest.
[[nodiscard]] std::vector<std::vector<sim::MotionPiece>> stretched_motion(const sim::Scenario& scenario,
                                                                          const Grid& grid,
                                                                          const std::vector<double>& knots,
                                                                          double duration_s);

struct PlantRun {
  bool rolled = false;  // N > 0 all the time
  sim::ContactExtrema extrema;
  double need = 0;     // greatest f_s / N, weighted by place (patched_floor.h), between nodes too
  bool slips = false;  // on the floor as it is, with its friction times the use that the task allows
  sim::Plant::Sample final{};
  double end_s = 0;
  std::vector<Node> nodes;  // the plant's states at the grid's nodes; fewer if it did not roll to the end
};

// Rolls the motion with prescribed masses on a floor of infinite friction: the caller judges the need. With patches it
// is rolled once more, to find slip on one that is smaller than the distance between two looks. `stop` is asked at each
// node, and 50 times in the second roll. Where it returns true the roll ends, and `rolled` is false.
[[nodiscard]] PlantRun roll_by_plant(const Problem& problem, const sim::Scenario& scenario, const Grid& grid,
                                     const std::vector<double>& knots, const std::function<bool()>& stop = {});

}  // namespace ballast::plan
