#include "sim/plant/extrema.h"

#include <algorithm>

namespace ballast::sim {

namespace {

// Two forces closer than this part of the weight, and two ratios closer than this, differ by rounding only.
constexpr double kNoise = 1e-13;

// An extremum moves only if it is beaten by more than rounding, so that a constant keeps its first time.
bool beats(double value, const Extremum& best, double noise) { return value > best.value + noise || best.time_s < 0; }

void raise(Extremum& best, double value, double time_s, double noise) {
  if (beats(value, best, noise)) best = {value, time_s};
}

}  // namespace

ContactRecord::ContactRecord(double force_scale_n) : noise_n_(kNoise * force_scale_n) {}

void ContactRecord::begin_tick(double normal_force_n, double mu_required) {
  tick_normal_force_min_n_ = reported_normal_n(normal_force_n);
  tick_mu_required_max_ = mu_required;
}

void ContactRecord::record_tick(double normal_force_min_n, double mu_required_max) {
  const double least = std::max(normal_force_min_n, extrema_.normal_force_min.value);
  const double most = std::min(mu_required_max, extrema_.mu_required_max.value);
  tick_normal_force_min_n_ = std::min(tick_normal_force_min_n_, least);
  tick_mu_required_max_ = std::max(tick_mu_required_max_, most);
}

void ContactRecord::record_mu(const Equations& equations, double time_s, const State& y, const Instant& motion) {
  const double mu = equations.contact.mu_required(motion);
  tick_mu_required_max_ = std::max(tick_mu_required_max_, mu);
  if (!beats(mu, extrema_.mu_required_max, kNoise)) return;
  extrema_.mu_required_max = {mu, time_s};
  at_mu_max_.regime = equations.contact.regime;
  at_mu_max_.y = y;
  at_mu_max_.push_W_n = equations.body.external_force.push_W_n();
  at_mu_max_.rolling_resistance_m = equations.body.floor.rolling_resistance_m;
  if (equations.driven()) {
    at_mu_max_.masses.acceleration = motion.mass_acceleration;
  } else {
    at_mu_max_.masses = equations.prescribed.at(time_s);
  }
}

void ContactRecord::record(const Equations& equations, double time_s, const State& y, const Instant& motion) {
  record_mu(equations, time_s, y, motion);
  const double normal_force_n = reported_normal_n(motion.normal_force_n);
  raise(extrema_.normal_force_max, normal_force_n, time_s, noise_n_);
  raise(extrema_.static_friction_max, motion.static_friction_n, time_s, noise_n_);
  Extremum least{-extrema_.normal_force_min.value, extrema_.normal_force_min.time_s};
  raise(least, -normal_force_n, time_s, noise_n_);
  extrema_.normal_force_min = {-least.value, least.time_s};
  tick_normal_force_min_n_ = std::min(tick_normal_force_min_n_, normal_force_n);
}

std::optional<ContactShares> ContactRecord::shares_at_mu_required_max(const Equations& equations) const {
  if (at_mu_max_.regime != Regime::kRolling) return std::nullopt;
  const double time_s = extrema_.mu_required_max.time_s;
  const double* y = at_mu_max_.y.data();
  MassPoint masses = at_mu_max_.masses;
  if (equations.driven()) {
    masses = equations.mass_point(time_s, y);
    masses.acceleration = at_mu_max_.masses.acceleration;
  }
  Body body = equations.body;
  body.external_force.set_push(at_mu_max_.push_W_n);
  body.floor.resist(at_mu_max_.rolling_resistance_m);
  return contact_shares(body, time_s, y + kQ, y + kOmega, equations.carried(masses));
}

}  // namespace ballast::sim
