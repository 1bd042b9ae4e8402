// Sequential quadratic programming from one start.
//
// Each iteration linearises the transcription about a motion and solves a quadratic program for a better one: the least
// greatest f_s / N, limits at an l1 price, equalities by an augmented Lagrangian, and Levenberg-Marquardt damping that
// adapts to how well the model predicts. A step is taken only if it lowers the true merit.
#pragma once

#include <functional>
#include <vector>

#include "tools/plan/transcription.h"

namespace ballast::plan {

// The budget of a search, and how it is stopped. Effort is counted in iterations, so that results do not depend on the
// speed of the machine.
struct Effort {
  int iterations = 0;           // so far, of all searches
  std::function<bool()> stop;   // asked before each iteration; true ends the search
  std::function<bool()> ended;  // by the caller: true leaves out what follows the iterations too
  std::function<void(double need, double error)> progress;
};

// How good a motion is on the planner's own model.
struct Merit {
  double need = 0;      // greatest f_s / N at the nodes
  double effort = 0;    // mean square of the scaled accelerations
  double equality = 0;  // greatest magnitude of an equality
  double limit = 0;     // greatest violation of a limit
  Limit worst_limit{};
  EqualityKind worst_equality{};
  [[nodiscard]] double error() const { return std::max(equality, limit); }
};

struct SqpSettings {
  Objective objective = Objective::kFriction;  // kTime counts as kFriction: the duration is the caller's
  double friction_limit = 1e300;               // of f_s / N; used where it is not the objective
  int most_iterations = 60;
  double tolerance = 2e-3;   // relative improvement below which it ends once all limits hold
  double good_enough = 0;    // need at which it ends once all limits hold
  bool short_steps = false;  // from a motion that is nearly right
  double most_equality = 1e-5, most_limit = 1e-5;
  bool gives_up = false;  // where it crawls far from the equalities: another start is cheaper
};

// Improves `knots`, in which entries of a fixed knot stay as they are. The rollout behind `transcription` is left at
// the result, differentiated.
Merit improve(Rollout& rollout, Transcription& transcription, const std::vector<bool>& fixed,
              const SqpSettings& settings, std::vector<double>& knots, Effort& effort);

// `tolerance`: by how much a limit of each kind may be passed; none: not at all.
[[nodiscard]] Merit judge(const Transcription& transcription, const std::vector<double>& knots,
                          const std::function<double(LimitKind)>& tolerance = {});

// The acceleration that counts as 1, of each mass.
[[nodiscard]] double acceleration_unit(const Problem& problem, int mass);

}  // namespace ballast::plan
