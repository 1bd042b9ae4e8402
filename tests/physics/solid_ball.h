// A ball without masses: what moves it is outside.
#pragma once

#include <algorithm>

#include "sim/plant/plant.h"
#include "sim/scenario/scenario.h"

namespace ballast::sim {

// Homogeneous: 2/5 m r^2.
inline Scenario solid_ball() {
  Scenario s;
  s.duration_s = 3;
  s.gravity_mps2 = 9.81;
  s.run.actuation = Actuation::kPrescribed;
  s.run.on_violation = OnViolation::kContinue;
  s.ball = {.radius_m = 0.1,
            .mass_kg = 0.5,
            .inertia_kgm2 = Eigen::Vector3d::Constant(0.4 * 0.5 * 0.1 * 0.1),
            .center_of_mass_B_m = Eigen::Vector3d::Zero()};
  return s;
}

inline void go(Plant& plant, double end_s, double period_s) {
  for (int k = 1; plant.time_s() < end_s && plant.end() == PhysicsEnd::kNone; ++k) {
    plant.advance(std::min(k * period_s, end_s), {});
  }
}

}  // namespace ballast::sim
