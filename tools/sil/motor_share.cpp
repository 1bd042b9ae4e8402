#include "tools/sil/motor_share.h"

#include <cmath>

namespace ballast::sil {

namespace {

// A NaN (both infinite) is no deviation.
void widen(Deviation& greatest, double real, double commanded, double time_s) {
  const double difference = std::abs(real - commanded);
  if (difference > std::abs(greatest.difference()) || (greatest.time_s < 0 && difference == 0)) {
    greatest = {real, commanded, time_s};
  }
}

}  // namespace

void MotorShare::observe(const contact_t& contact) {
  if (std::isnan(contact.commanded_normal_force_n) || contact.regime != contact_t::REGIME_ROLLING) return;
  const double time_s = contact.time_s;
  widen(normal_force_n, contact.normal_force_n, contact.commanded_normal_force_n, time_s);
  widen(static_friction_n, contact.static_friction_n, contact.commanded_static_friction_n, time_s);
  widen(mu_required, contact.mu_required, contact.commanded_mu_required, time_s);
  sim::Extremum& most = commanded_mu_required_max;
  if (most.time_s < 0 || contact.commanded_mu_required > most.value) most = {contact.commanded_mu_required, time_s};
}

}  // namespace ballast::sil
