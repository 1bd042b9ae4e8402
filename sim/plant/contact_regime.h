// The regime the contact is in, and the conditions under which it goes on: physics.md section 4.
#pragma once

#include <Eigen/Core>

#include "sim/plant/plant_model.h"
#include "sim/plant/state.h"

namespace ballast::sim {

enum class Regime { kRolling, kSliding, kFlight };

// N as results and messages state it: 0 where rolling on would need the floor to pull. NaN stays NaN.
inline double reported_normal_n(double normal_force_n) { return normal_force_n < 0 ? 0 : normal_force_n; }
// f_s / N as results and messages state it in contact: +infinity where N <= 0.
double mu_required(double normal_force_n, double static_friction_n);

// The following speeds are in units of sqrt(g r). Their effect is small: a direction wrong by some 1e-6 for the 1e-6 to
// 1e-4 sqrt(r/g) that a slip mostly takes to reach its threshold. A slip that creeps to it in 1e-3 sqrt(r/g), with a
// kinetic friction equal to the static one and forces that change slowly, moved the ball by 1e-11 r.
inline constexpr double kRestSpeed = 1e-6;  // an impact slower than this ends the bouncing
inline constexpr double kSlipBegins = 1e-6;
inline constexpr double kSlipVanishes = 1e-12;
// Part of the slip at the start of a step below which a stage of that step keeps the direction of the start: the
// direction of the remaining slip is rounding there.
inline constexpr double kSlipKept = 1e-3;

struct ContactRegime {
  explicit ContactRegime(const PlantModel& model, double total_mass_kg);

  // Whether the regime ends here.
  [[nodiscard]] bool over(const Instant& motion) const;
  // In sliding it is mu_k, in flight 0.
  [[nodiscard]] double mu_required(const Instant& motion) const;

  Regime regime = Regime::kRolling;
  double static_friction, kinetic_friction;  // of the floor under the ball
  double radius_m;
  double speed_scale_mps;  // sqrt(g r), with the external force per mass for g where that is greater

  // Sliding: the slip's direction as the step began. Slower than slip_kept_mps, the slip keeps it.
  Eigen::Vector2d slip_direction_W{1, 0};
  double slip_kept_mps = 0;
  bool slip_begins = false;  // the slip is too slow yet for a direction of its own
};

}  // namespace ballast::sim
