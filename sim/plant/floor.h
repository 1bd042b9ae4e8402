// Slope and resistance of the floor: physics.md, "Real floors".
#pragma once

#include <cmath>

#include "sim/plant/vec3.h"
#include "sim/plant/world.h"

namespace ballast::sim {

struct Floor {
  explicit Floor(const World& world)
      : slopes(world.surface.slope_rad != 0),
        spin_friction_m(world.surface.spin_friction_m),
        creep2(world.creep_radps() * world.creep_radps()) {
    resist(world.surface.rolling_resistance * world.ball.radius_m);
    const double angle = world.surface.slope_rad, downhill = world.surface.downhill_rad;
    if (!slopes) return;
    against_weight_W = {-std::sin(angle) * std::cos(downhill), -std::sin(angle) * std::sin(downhill), std::cos(angle)};
  }

  // Sets c_rr r, which may change with place.
  void resist(double resistance_m) {
    rolling_resistance_m = resistance_m;
    resists = rolling_resistance_m > 0 || spin_friction_m > 0;
  }

  [[nodiscard]] bool ideal() const { return !slopes && !resists; }

  // T_W / N in m, for the angular velocity in the space frame.
  template <class T>
  [[nodiscard, gnu::always_inline]] Vec3<T> moment_W_m(const Vec3<T>& omega_W) const {
    using std::sqrt;
    const T rolling = -rolling_resistance_m / sqrt(omega_W.x * omega_W.x + omega_W.y * omega_W.y + creep2);
    const T spinning = -spin_friction_m / sqrt(omega_W.z * omega_W.z + creep2);
    return {rolling * omega_W.x, rolling * omega_W.y, spinning * omega_W.z};
  }

  bool slopes;
  bool resists = false;                    // there is a moment
  Vec3<double> against_weight_W{0, 0, 1};  // -g_W / g, of unit length
  double rolling_resistance_m = 0;         // c_rr r
  double spin_friction_m;                  // c_spin
  double creep2;                           // omega_c^2
};

}  // namespace ballast::sim
