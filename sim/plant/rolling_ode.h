// The rolling ball with prescribed masses as an ordinary differential equation (the paper's rolling_ball_ode_f), for
// integrators of any kind.
//
// State: q (w, x, y, z; body to space), Omega (body frame), z (of the geometric centre, horizontal): nine numbers. The
// paper carries theta and thetadot of the masses along as well; here they are the closed form they are prescribed in.
//
// q need not have unit length: the right-hand side is that of q / |q| for Lambda, as the paper's q v q^-1 is, and q
// Omega / 2 for q's own rate, which keeps |q| as it is. Multistep and implicit methods let |q| drift by their error.
#pragma once

#include <array>
#include <vector>

#include "sim/masses/motion.h"
#include "sim/plant/newton_euler.h"

namespace ballast::sim {

class RollingOde {
 public:
  static constexpr std::size_t kQ = 0, kOmega = 4, kZ = 7, kSize = 9;
  using State = std::array<double, kSize>;

  explicit RollingOde(const World& world);

  [[nodiscard]] const Body& body() const { return body_; }
  [[nodiscard]] State initial_state() const;

  // The right-hand side is smooth between kinks: where a motion piece ends, a mass passes a knot of its spline rail, or
  // a trajectory or the table of the external force has a row. Everything below is that of the stretch that begin() was
  // last told of, even at its end, so that no step of an integrator sees a jump. At a kink begin() takes the stretch
  // after it.
  void begin(double time_s);
  [[nodiscard]] double end_s() const { return end_s_; }  // of the stretch; +infinity for the last

  [[nodiscard]] MassPoint masses(double time_s) const { return motion_.at(time_s); }

  // T: double or std::complex<double>.
  template <class T>
  void derivative(double time_s, const T* y, T* dydt) const;

  // d(dydt_i)/dy_k at out[i + 9 k], by complex step: f(y + i h e_k) / h with h so small that nothing but the derivative
  // is left, and no difference of near values is taken (the paper, section 5). Exact to rounding.
  void jacobian(double time_s, const double* y, double* out) const;

  void motion(double time_s, const double* y, MotionOf<double>& out) const;

 private:
  [[nodiscard]] CarriedMasses carried(double time_s) const;

  Body body_;
  State initial_;
  PrescribedMasses motion_;
  double begin_s_ = 0, end_s_ = 0;
};

}  // namespace ballast::sim
