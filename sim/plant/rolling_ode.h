// The rolling ball with prescribed masses as an ordinary differential equation (the paper's rolling_ball_ode_f), for
// integrators of any kind.
//
// State: q (w, x, y, z; body to space), Omega (body frame), z (of the geometric centre, horizontal): nine numbers. The
// paper carries theta and thetadot of the masses along as well; here they are the closed form they are prescribed in.
//
// q need not have unit length: Lambda is taken at q / |q|, as in the paper's q v q^-1, and q's own rate is q Omega / 2,
// which keeps |q|. Multistep and implicit methods let |q| drift by their error.
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
  // a trajectory or the table of the external force has a row. begin() chooses the stretch between two kinks that
  // starts at or before time_s; at a kink it is the stretch after it. Everything below belongs to that stretch, even at
  // its end, so that no step of an integrator meets a jump.
  void begin(double time_s);
  [[nodiscard]] double end_s() const { return end_s_; }  // end of the stretch; +infinity for the last

  [[nodiscard]] MassPoint masses(double time_s) const { return motion_.at(time_s); }

  // T: double or std::complex<double>.
  template <class T>
  void derivative(double time_s, const T* y, T* dydt) const;

  // d(dydt_i)/dy_k at out[i + 9 k], by complex step: the imaginary part of f(y + i h e_k) / h (the paper, section 5). h
  // is so small that higher terms vanish, and no difference of near values is taken. Exact to rounding.
  void jacobian(double time_s, const double* y, double* out) const;

 private:
  [[nodiscard]] CarriedMasses carried(double time_s) const;

  Body body_;
  State initial_;
  PrescribedMasses motion_;
  double begin_s_ = 0, end_s_ = 0;
};

}  // namespace ballast::sim
