// Finds a plan: several starts, continuation, and a polish against the plant.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "tools/plan/plant_check.h"
#include "tools/plan/sqp.h"

namespace ballast::plan {

enum class Status {
  kFound,
  kInfeasible,  // a bound that no motion of this robot passes stands in the way
  kNotFound,
};

// A motion and what the plant said of it.
struct Plan {
  Grid grid;
  std::vector<double> knots;
  PlantRun run;
  std::vector<double> via_time_s;
  double goal_error_m = 0;
  double stepper_need = 0;    // greatest f_s / N with the motors, where SearchOptions can tell
  double near_resonance = 0;  // part of the duration that some motor spends near a resonance
};

struct Outcome {
  Status status = Status::kNotFound;
  std::optional<Plan> plan;   // kFound: the best that holds
  std::optional<Plan> unfit;  // kNotFound: a plan that holds, but SearchOptions::fits refused it
  std::string binding;        // what limits it, in words
  int iterations = 0;
  bool friction_alone = false;  // kNotFound: the best motion tried meets everything but the friction limit
};

// Pieces of the shortest motion that a quick search begins with.
inline constexpr int kLeastQuickPieces = 20;

struct SearchOptions {
  std::uint64_t seed = 0;
  int most_iterations = 2000;                       // until a plan is found
  std::vector<std::vector<sim::MotionPiece>> from;  // motion of each mass to start from; empty: none
  // Tolerance on the equalities, over r, sqrt(g r) and the like, as the plant rolls them; none: that of plans, which
  // are followed without feedback. The last tenths of a millimetre cost most of a search's time.
  std::optional<double> equality_tolerance;
  // Takes the first plan that holds. With `from`: in half the time, for a few percent more friction. Without it: as
  // soon as half of the friction limit is enough.
  bool quick = false;
  int most_starts = 0;  // until a plan is found; 0: a few dozen, or a few where it is to be quick
  // A plan that holds and does not fit ends its start; the search goes on with the next one. None: all fit.
  std::function<bool(const Plan&)> fits;
  std::function<bool()> stop;  // ends the search with the best plan so far
  // Greatest f_s / N of the motion when the scenario's motors drive it; infinite if the run does not complete. None:
  // the search does not ask.
  std::function<double(const sim::Scenario& moved)> stepper_need;
  // Best need so far (infinite: none), the running search's need and its greatest violation.
  std::function<void(int iteration, double best, double need, double error)> progress;
};

[[nodiscard]] Outcome search(const Problem& problem, const sim::Scenario& scenario, const SearchOptions& options);

}  // namespace ballast::plan
