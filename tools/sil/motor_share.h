// The motors' share: how far N, f_s and f_s / N of the real motion go from those of the commanded one. From the contact
// messages, so at the ticks, and while the ball rolls: in sliding f_s is no friction that is needed.
#pragma once

#include "hal/lcm/messages.h"
#include "sim/plant/plant.h"

namespace ballast::sil {

// Where real and commanded were furthest apart.
struct Deviation {
  double real = 0;
  double commanded = 0;
  double time_s = -1;  // before the start: none seen
  // Infinite where only one of the two is finite.
  [[nodiscard]] double difference() const { return real - commanded; }
};

struct MotorShare {
  Deviation normal_force_n;
  Deviation static_friction_n;
  Deviation mu_required;
  sim::Extremum commanded_mu_required_max{0, -1};

  // Messages without a command (their commanded_ fields are NaN) say nothing.
  void see(const contact_t& contact);
  [[nodiscard]] bool seen() const { return normal_force_n.time_s >= 0; }
};

}  // namespace ballast::sil
