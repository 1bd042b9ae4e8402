// The state that the plant has reached and the records of the run up to there.
#pragma once

#include "sim/plant/equations.h"
#include "sim/plant/extrema.h"
#include "sim/plant/motor_record.h"

namespace ballast::sim {

struct Progress {
  explicit Progress(const PlantModel& model);

  // Records contact and motors as they are now.
  void record();
  // The required friction alone, where the forces do not come about.
  void record_mu() { contact.record_mu(dynamics.equations, dynamics.time_s, dynamics.now.y, dynamics.now.motion); }
  // Determines which end stops push from now on.
  void update_stops();
  [[nodiscard]] bool regime_over() const { return dynamics.equations.contact.over(dynamics.now.motion); }

  Dynamics dynamics;
  ContactRecord contact;
  MotorRecord motors;
};

}  // namespace ballast::sim
