#include "tools/plan/words.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace ballast::plan {

std::string limit_words(const Limit& limit) {
  switch (limit.kind) {
    case LimitKind::kNormalForce:
      return "the normal force (envelope.min_normal_force)";
    case LimitKind::kRailEnd:
      return fmt::format("the rail end of mass {}", limit.index);
    case LimitKind::kSpeed:
      return fmt::format("the step rate of mass {} (motor.max_step_rate)", limit.index);
    case LimitKind::kAcceleration:
      return fmt::format("the acceleration of mass {} (motor.max_acceleration)", limit.index);
    case LimitKind::kJerk:
      return fmt::format("the jerk of mass {} (motor.max_jerk)", limit.index);
    case LimitKind::kTorque:
      return fmt::format("the torque of mass {} (motor.holding_torque, task.torque_margin)", limit.index);
    case LimitKind::kResonance:
      return fmt::format("the resonance of motor {} (task.avoid_resonance)", limit.index);
    case LimitKind::kKeepOut:
      return fmt::format("task.keep_out.{}", limit.index);
    case LimitKind::kFollow:
      return "the path (task.follow.tolerance)";
    case LimitKind::kStability:
      return "stability (task.at_rest): the centre of mass stays above the geometric centre";
    case LimitKind::kRestSpin:
      return "the turn about the vertical at the end (task.at_rest)";
  }
  return "";
}

std::string equality_words(const EqualityKind& kind) {
  switch (kind.kind) {
    case EqualityKind::kGoal:
      return "the goal (task.goal)";
    case EqualityKind::kVia:
      return fmt::format("task.via.{}", kind.index);
    case EqualityKind::kSpin:
      return "rest of the ball (task.at_rest)";
    case EqualityKind::kMassRate:
      return fmt::format("rest of mass {} (task.at_rest)", kind.index);
    case EqualityKind::kBalance:
      return "balance at the end (task.at_rest)";
    case EqualityKind::kMassPosition:
      return fmt::format("task.mass_position.{}", kind.index);
  }
  return "";
}

std::string binding_words(const Transcription& truth, const std::vector<double>& knots, Objective objective) {
  std::vector<std::string> words;
  const auto note = [&](const Limit& limit) {
    constexpr double kTouched = 0.99;
    const bool one_sided = limit.kind == LimitKind::kKeepOut || limit.kind == LimitKind::kNormalForce;
    const bool touches = one_sided ? limit.value < 1.01 * limit.lower
                                   : limit.value > kTouched * limit.upper || limit.value < kTouched * limit.lower;
    if (limit.kind == LimitKind::kRailEnd || limit.kind == LimitKind::kStability || !touches) return;
    const std::string word = limit_words(limit);
    if (std::find(words.begin(), words.end(), word) == words.end()) words.push_back(word);
  };
  truth.limits(false, [&](const Limit& limit, const NodeForm&) { note(limit); });
  const Problem& problem = truth.problem();
  const auto n = static_cast<std::size_t>(problem.masses());
  const double piece_s = truth.rollout().grid().piece_s();
  for (std::size_t v = 0; v + n < knots.size(); ++v) {
    const MassLimits& limits = problem.limits[v % n];
    const int mass = static_cast<int>(v % n);
    if (std::isfinite(limits.acceleration))
      note({LimitKind::kAcceleration, mass, 0, knots[v] / limits.acceleration, -1, 1});
    if (std::isfinite(limits.jerk)) {
      note({LimitKind::kJerk, mass, 0, (knots[v + n] - knots[v]) / piece_s / limits.jerk, -1, 1});
    }
  }
  std::string text = objective == Objective::kFriction ? "the time (task.duration)" : "";
  if (objective == Objective::kTime) text = "friction (task.friction_use, surface.static_friction)";
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? "nothing but the task itself" : text;
}

}  // namespace ballast::plan
