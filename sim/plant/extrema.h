// The extrema of the contact over a run and over a tick.
#pragma once

#include <limits>
#include <optional>

#include "sim/plant/contact_shares.h"
#include "sim/plant/equations.h"

namespace ballast::sim {

// A value and when it was taken.
struct Extremum {
  double value = 0;
  double time_s = -1;  // before the start: never
};

// Over the whole run. The very end of a slide is left out, because the direction of the slip has no limit there that a
// step could follow. In sliding f_s is the kinetic friction, so f_s / N is mu_k. In flight N = f_s = 0 and no friction
// is required. Impulses are not forces and do not count.
struct ContactExtrema {
  Extremum mu_required_max;  // f_s / N; +infinity once rolling would need N <= 0
  Extremum normal_force_min;
  Extremum normal_force_max;
  Extremum static_friction_max;
};

class ContactRecord {
 public:
  // `force_scale_n`: forces that differ by less than 1e-13 of it are the same, up to rounding.
  explicit ContactRecord(double force_scale_n);

  void record(const Equations& equations, double time_s, const State& y, const Instant& motion);
  // The required friction alone, where the other forces do not come about.
  void record_mu(const Equations& equations, double time_s, const State& y, const Instant& motion);
  // Extrema of the tick that were found less exactly: they never pass those of the run.
  void record_tick(double normal_force_min_n, double mu_required_max);
  // Starts the extrema of a tick with the values now.
  void begin_tick(double normal_force_n, double mu_required);

  [[nodiscard]] bool empty() const { return extrema_.normal_force_min.time_s < 0; }
  [[nodiscard]] const ContactExtrema& extrema() const { return extrema_; }
  [[nodiscard]] double tick_normal_force_min_n() const { return tick_normal_force_min_n_; }
  [[nodiscard]] double tick_mu_required_max() const { return tick_mu_required_max_; }

  // The parts that shell, masses and external force have in mu_required_max; none if it was not needed by rolling.
  [[nodiscard]] std::optional<ContactShares> shares_at_mu_required_max(const Equations& equations) const;

 private:
  double noise_n_;
  ContactExtrema extrema_;
  double tick_normal_force_min_n_ = std::numeric_limits<double>::infinity();
  double tick_mu_required_max_ = 0;
  // The least that determines the contact at mu_required_max.
  struct {
    Regime regime = Regime::kFlight;
    State y{};
    Vec3<double> push_W_n{};
    double rolling_resistance_m = 0;  // of the floor under the ball
    MassPoint masses{};               // of driven masses the accelerations only
  } at_mu_max_;
};

}  // namespace ballast::sim
