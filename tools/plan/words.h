// Limits and conditions of a plan in words.
#pragma once

#include <string>

#include "tools/plan/sqp.h"

namespace ballast::plan {

// "the torque of mass 0 (motor.holding_torque, task.torque_margin)"
[[nodiscard]] std::string limit_words(const Limit& limit);
// "the goal"
[[nodiscard]] std::string equality_words(const EqualityKind& kind);

// Names what binds a plan: limits used to 99 %, or the motion itself.
[[nodiscard]] std::string binding_words(const Transcription& truth, const std::vector<double>& knots,
                                        Objective objective);

}  // namespace ballast::plan
