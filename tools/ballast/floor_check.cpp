#include "tools/ballast/floor_check.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "sim/plant/plant.h"
#include "tools/program/short_number.h"

namespace ballast {
namespace {

using program::short_number;
using program::short_time;

constexpr double kMostLookedAt_s = 1000;
constexpr int kPieces = 1000;  // a piece of the time needs no more steps than the plant allows

std::string too_much_friction(const sim::Extremum& needed, const sim::Scenario& scenario) {
  const double given = scenario.surface.static_friction, allowed = scenario.envelope.friction_use * given;
  const std::string motion =
      fmt::format("the motion needs f_s / N = {} at t = {} s", short_number(needed.value), short_time(needed.time_s));
  if (needed.value > given) {
    return fmt::format("surface.static_friction: {}, and this floor gives {}: the ball slips; a slower motion helps",
                       motion, short_number(given));
  }
  return fmt::format("envelope.friction_use: {}, and {} of this floor's {} is {}: the run trips", motion,
                     short_number(scenario.envelope.friction_use), short_number(given), short_number(allowed));
}

}  // namespace

std::vector<std::string> check_floor(const sim::Scenario& scenario) {
  sim::Scenario rolled = scenario;
  rolled.run.actuation = sim::Actuation::kPrescribed;
  rolled.run.on_violation = sim::OnViolation::kStop;
  rolled.surface.static_friction = std::numeric_limits<double>::infinity();
  rolled.faults.clear();
  sim::Plant plant(rolled);
  if (plant.regimes().front().regime != sim::Regime::kRolling) return {};
  const double end_s = std::min(scenario.duration_s, kMostLookedAt_s);
  for (int k = 1; k <= kPieces && plant.end() == sim::PhysicsEnd::kNone; ++k) plant.advance(end_s * k / kPieces, {});

  const sim::ContactExtrema& most = plant.extrema();
  std::vector<std::string> warnings;
  if (plant.rolling_lost()) {
    warnings.push_back(fmt::format("motion: lifts the ball off the floor at t = {} s; a slower motion helps",
                                   short_time(plant.time_s())));
  } else if (most.normal_force_min.value < scenario.envelope.min_normal_force_n) {
    warnings.push_back(fmt::format(
        "envelope.min_normal_force: the motion lowers N to {} N at t = {} s, and {} N are asked for: the run trips",
        short_number(most.normal_force_min.value), short_time(most.normal_force_min.time_s),
        short_number(scenario.envelope.min_normal_force_n)));
  }
  if (std::isfinite(most.mu_required_max.value) &&
      most.mu_required_max.value > scenario.envelope.friction_use * scenario.surface.static_friction) {
    warnings.push_back(too_much_friction(most.mu_required_max, scenario));
  }
  return warnings;
}

}  // namespace ballast
