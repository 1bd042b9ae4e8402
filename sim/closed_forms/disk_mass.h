// The terms of one mass in the disk's closed forms, rolling and detached.
#pragma once

#include "sim/closed_forms/rolling_disk.h"

namespace ballast::closed_forms {

// Body components 1 and 3, from the geometric centre.
template <class T>
struct DiskMass {
  Real mass;
  T zeta1, zeta3;
  // e1 = -2 phidot thetadot_i zeta_i,3' + thetadot_i^2 zeta_i,1'' + thetaddot_i zeta_i,1'; e3 is its like along E3.
  T e1, e3;
  T q, p;  // Q_i and P_i of eq_detach_disk_1d: e with the centripetal part, the components of c_i
};

// Index -1 is the shell, the paper's 0.
template <class T, class Motion>
DiskMass<T> disk_mass(const BallParams& ball, const T& spin, const Motion& masses, int i) {
  DiskMass<T> out{ball.shell_mass_kg, ball.center_of_mass_B_m[0], ball.center_of_mass_B_m[2], 0, 0, 0, 0};
  if (i >= 0) {
    const auto k = static_cast<std::size_t>(i);
    const auto rail = firmware::evaluate<T>(ball.rail[k], masses.position[k]);
    const T rate = masses.velocity[k], acceleration = masses.acceleration[k];
    out.mass = ball.mass_kg[k];
    out.zeta1 = rail.position[0];
    out.zeta3 = rail.position[2];
    out.e1 = Real(-2) * spin * rate * rail.d1[2] + rate * rate * rail.d2[0] + acceleration * rail.d1[0];
    out.e3 = Real(2) * spin * rate * rail.d1[0] + rate * rate * rail.d2[2] + acceleration * rail.d1[2];
  }
  out.q = out.e1 - spin * spin * out.zeta1;
  out.p = out.e3 - spin * spin * out.zeta3;
  return out;
}

}  // namespace ballast::closed_forms
