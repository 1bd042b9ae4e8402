#include "tools/ballast/floor_check.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "sim/plant/plant.h"
#include "tools/program/short_number.h"

namespace ballast {
namespace {

using program::short_number;
using program::short_time;

constexpr double kMostLookedAt_s = 1000;
constexpr int kPieces = 1000;  // a piece of the time needs no more steps than the plant allows

// Whether a mass is being accelerated, or has been.
bool moved_by(const sim::Scenario& scenario, double time_s) {
  return std::any_of(scenario.masses.begin(), scenario.masses.end(), [&](const sim::Mass& mass) {
    double begin_s = 0;
    for (const sim::MotionPiece& piece : mass.motion) {
      if (begin_s > time_s) return false;
      if (piece.acceleration_start != 0 || piece.acceleration_end != 0) return true;
      begin_s += piece.duration_s;
    }
    return false;
  });
}

// The texts' subject and advice: masses that have not been moved yet are not to blame.
struct Cause {
  Cause(const sim::Scenario& scenario, double time_s)
      : what(moved_by(scenario, time_s) ? "the motion" : "the ball"),
        advice(moved_by(scenario, time_s) ? "; a slower motion helps" : "") {}
  std::string what, advice;
};

std::string too_much_friction(const sim::Extremum& needed, const sim::Scenario& scenario) {
  const double given = scenario.surface.static_friction, allowed = scenario.envelope.friction_use * given;
  const Cause cause(scenario, needed.time_s);
  const std::string needs = fmt::format("{} needs f_s / N = {} at t = {} s", cause.what, short_number(needed.value),
                                        short_time(needed.time_s));
  if (needed.value > given) {
    return fmt::format("surface.static_friction: {}, and this floor gives {}: the ball slips{}", needs,
                       short_number(given), cause.advice);
  }
  return fmt::format("envelope.friction_use: {}, and {} of this floor's {} is {}: the run trips", needs,
                     short_number(scenario.envelope.friction_use), short_number(given), short_number(allowed));
}

sim::Scenario as_prescribed(sim::Scenario scenario) {
  scenario.run.actuation = sim::Actuation::kPrescribed;
  scenario.run.on_violation = sim::OnViolation::kStop;
  scenario.faults.clear();
  return scenario;
}

// Rolls the ball to where a patch holds less than the floor around it.
void add_slip_on_patch(const sim::Scenario& scenario, double end_s, FloorFindings& findings) {
  sim::Plant plant(as_prescribed(scenario));
  for (int k = 1; k <= kPieces && plant.end() == sim::PhysicsEnd::kNone; ++k) plant.advance(end_s * k / kPieces, {});
  const sim::Sample end = plant.sample();
  if (plant.end() != sim::PhysicsEnd::kSlipped || end.floor_static_friction >= scenario.surface.static_friction) return;
  findings.warnings.push_back(
      fmt::format("surface.patch: at t = {} s the ball is at ({}, {}) m on a patch of mu_s = {}, and slips{}",
                  short_time(plant.time_s()), short_number(end.position_W_m[0]), short_number(end.position_W_m[1]),
                  short_number(end.floor_static_friction), Cause(scenario, plant.time_s()).advice));
}

}  // namespace

FloorFindings check_floor(const sim::Scenario& scenario) {
  sim::Scenario rolled = as_prescribed(scenario);
  rolled.surface.hold_everything();
  sim::Plant plant(rolled);
  if (plant.regimes().front().regime != sim::Regime::kRolling) return {};
  const double end_s = std::min(scenario.duration_s, kMostLookedAt_s);
  // Where the ball lifts off, f_s / N is infinite and N is 0: the extremes up to the piece before are those of rolling.
  sim::ContactExtrema most = plant.extrema();
  for (int k = 1; k <= kPieces && plant.end() == sim::PhysicsEnd::kNone; ++k) {
    plant.advance(end_s * k / kPieces, {});
    if (!plant.rolling_lost()) most = plant.extrema();
  }

  FloorFindings findings;
  if (!scenario.surface.patches.empty()) add_slip_on_patch(scenario, end_s, findings);
  const double least_n = scenario.envelope.min_normal_force_n;
  if (most.mu_required_max.value > scenario.envelope.friction_use * scenario.surface.static_friction)
    findings.warnings.push_back(too_much_friction(most.mu_required_max, scenario));
  if (most.normal_force_min.value <= least_n) {
    findings.warnings.push_back(
        fmt::format("envelope.min_normal_force: {} lowers N to {} N at t = {} s, and more than {} N are asked for: the "
                    "run trips",
                    Cause(scenario, most.normal_force_min.time_s).what, short_number(most.normal_force_min.value),
                    short_time(most.normal_force_min.time_s), short_number(least_n)));
  }
  if (plant.rolling_lost()) {
    const Cause cause(scenario, plant.time_s());
    findings.warnings.push_back(fmt::format("{} lifts off the floor at t = {} s{}",
                                            cause.advice.empty() ? "the ball" : "motion: the ball",
                                            short_time(plant.time_s()), cause.advice));
  } else if (plant.end() != sim::PhysicsEnd::kNone) {
    findings.warnings.push_back(
        fmt::format("the run ends at t = {} s: {}", short_time(plant.time_s()), plant.end_text()));
  } else if (end_s < scenario.duration_s) {
    findings.notes.push_back(fmt::format("the floor is checked up to t = {} s only", short_time(end_s)));
  }
  return findings;
}

}  // namespace ballast
