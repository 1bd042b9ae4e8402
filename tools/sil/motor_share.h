// The motors' share: how far N, f_s and f_s / N of the real motion deviate from those of the commanded motion. Taken
// from the contact messages, so at the ticks, and while the ball rolls: in sliding f_s is not a friction needed.
#pragma once

#include "hal/lcm/messages.h"
#include "sim/plant/plant.h"

namespace ballast::sil {

// The greatest deviation of a quantity.
struct Deviation {
  double real = 0;
  double commanded = 0;
  double time_s = -1;  // before the start: none
  // Infinite where only one of the two is finite.
  [[nodiscard]] double difference() const { return real - commanded; }
};

struct MotorShare {
  Deviation normal_force_n;
  Deviation static_friction_n;
  Deviation mu_required;
  sim::Extremum commanded_mu_required_max{0, -1};

  // Ignores messages without a command, whose commanded_ fields are NaN.
  void observe(const contact_t& contact);
  [[nodiscard]] bool seen() const { return normal_force_n.time_s >= 0; }
};

}  // namespace ballast::sil
