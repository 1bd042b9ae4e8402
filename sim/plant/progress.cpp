#include "sim/plant/progress.h"

#include <algorithm>

namespace ballast::sim {

Progress::Progress(const PlantModel& model)
    : dynamics(model),
      contact(std::max(dynamics.equations.body.total_mass_kg * model.gravity_mps2, model.greatest_force_n())) {
  update_stops();
}

void Progress::record() {
  contact.record(dynamics.equations, dynamics.time_s, dynamics.now.y, dynamics.now.motion);
  motors.record(dynamics);
}

void Progress::update_stops() {
  MotorDrives& drives = dynamics.equations.motors;
  const State& y = dynamics.now.y;
  for (const std::size_t i : drives.with_stops()) {
    if (drives.update_stop(i, y[kTheta + i], y[kTheta + drives.size() + i])) motors.record_touch(i, dynamics.time_s);
  }
}

}  // namespace ballast::sim
