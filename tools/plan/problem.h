// The planning problem: the robot, where it starts, the task, and the limits. It knows nothing of how a plan is found.
// Units consistent; keys: tools/docs/plan.md.
#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <vector>

#include "sim/motors/stepper.h"
#include "tools/plan/patched_floor.h"
#include "tools/tracking/rolling_model.h"

namespace ballast::plan {

enum class Objective {
  kFriction,  // the least maximum of f_s / N
  kTime,      // the shortest duration
  kEffort,    // the least integral of squared rail accelerations
};

struct Via {
  Eigen::Vector2d position_m;
  std::optional<double> time_s;  // none: at any time, in the order of the list
};

// The ball's silhouette stays outside.
struct KeepOut {
  Eigen::Vector2d center_m;
  double radius_m;
};

// The geometric centre stays this near to the polyline.
struct Follow {
  std::vector<Eigen::Vector2d> points_m;
  double tolerance_m;
};

struct Task {
  Eigen::Vector2d goal_m = Eigen::Vector2d::Zero();
  bool at_rest = true;
  // rad/s: at rest on a level floor the ball may still turn about the vertical, up to this. 0: it may not. A turn that
  // it has is hard to end: no force at the contact point has a moment about it. Tasks have no key for it: `go` sets it.
  double rest_spin_radps = 0;
  double duration_s = 0;  // with kTime the longest allowed
  Objective objective = Objective::kFriction;
  double friction_use = 0.8;
  std::vector<Via> via;
  std::vector<KeepOut> keep_out;
  std::vector<double> mass_position;  // empty: free
  std::optional<Follow> follow;
  bool avoid_resonance = true;
  double torque_margin = 0.5;
};

// The limits of one mass. Infinite: no limit.
struct MassLimits {
  double lower = -std::numeric_limits<double>::infinity(), upper = std::numeric_limits<double>::infinity();
  double speed = std::numeric_limits<double>::infinity();
  double acceleration = std::numeric_limits<double>::infinity();
  double jerk = std::numeric_limits<double>::infinity();
  // Rail speeds at which the full steps come at the natural frequency of rotor and mass, and at twice it.
  std::vector<double> resonant_speeds;
  std::optional<sim::Stepper> motor;  // torque and resonance are judged only where a motor drives the mass
};

struct Problem {
  Robot robot;
  RollingState start;                                 // its accelerations are those with which motors begin
  Eigen::Vector2d start_m = Eigen::Vector2d::Zero();  // of the geometric centre
  Task task;
  PatchedFloor floor;
  double friction_limit = std::numeric_limits<double>::infinity();  // weighted f_s / N: friction_use mu_s (reference)
  double least_normal_n = 0;
  PerMass<MassLimits> limits;
  double metres_per_unit[kMaxMasses] = {};  // |zeta'|

  [[nodiscard]] int masses() const { return robot.ball.mass_count; }
};

// Length, time and speed by which errors are made dimensionless: r, sqrt(r / g), sqrt(g r). Without gravity the time
// is 1.
[[nodiscard]] double time_unit_s(const Problem& problem);

// The floor resists somewhere.
inline bool resists(const Problem& problem) {
  return resists(problem.robot.ball) || problem.floor.greatest_rolling_resistance() > 0;
}

}  // namespace ballast::plan
