// The currents of a two-phase hybrid stepper under a chopper driver: the part of the commanded current that the supply
// can drive through the winding at a speed. Derivation: physics.md, section 8.
//
// Both phases are one vector in the rotor's frame, d along the magnet, q a quarter of an electrical turn ahead. Its
// length is sqrt(i_a^2 + i_b^2): sqrt(2) times the rms current of sine microstepping, and of both phases full on at the
// rated current, which is how datasheets state holding torque and heat (2 I^2 R). The torque is K i_q, the back EMF
// K phidot along q, with K = tau_hold / (sqrt(2) rated current).
//
// The chopper commands a current of full length at the angle `lag` from d and has a voltage vector of at most the
// supply's length. The winding follows a microstep within 0.1 ms, so the model is quasi-static: the current turns
// evenly with the field's mean speed, and the back EMF follows the rotor's speed at the instant, which swings about it.
#pragma once

#include <cmath>

#include "firmware/model/sin_cos.h"
#include "sim/motors/motor.h"

namespace ballast::sim {

class PhaseCurrent {
 public:
  struct Vector {
    double direct_a = 0, quadrature_a = 0;
    [[nodiscard]] double squared() const { return direct_a * direct_a + quadrature_a * quadrature_a; }
  };
  // The greatest torque against a load, and the lag at which the motor gives it.
  struct PullOut {
    double torque_nm, lag_rad;
  };

  PhaseCurrent() = default;                   // no winding
  explicit PhaseCurrent(const Motor& motor);  // requires motor.has_winding()

  // The current at a lag of the rotor (electrical angle from d to the commanded current), a speed of the shaft and one
  // of the field, in rad/s of the shaft. It is the commanded current where the supply suffices. Otherwise the whole
  // supply voltage points along the missing current and balances resistance, inductance and back EMF. Continuous in all
  // arguments.
  [[nodiscard]] Vector at(double lag_rad, double shaft_radps, double field_radps) const {
    const firmware::SinCos<double> lag = firmware::sin_cos(lag_rad);
    const double d = amplitude_a_ * lag.cos, q = amplitude_a_ * lag.sin;
    const double reactance = inductance_per_rad_h_ * field_radps;
    const double v_d = resistance_ohm_ * d - reactance * q;
    const double v_q = resistance_ohm_ * q + reactance * d + torque_constant_nmpa_ * shaft_radps;
    const double needed2 = v_d * v_d + v_q * v_q;
    return needed2 <= supply_v_ * supply_v_ ? Vector{d, q} : limited({d, q}, {v_d, v_q}, reactance);
  }

  [[nodiscard]] double torque_nm(double lag_rad, double shaft_radps, double field_radps) const {
    return torque_constant_nmpa_ * at(lag_rad, shaft_radps, field_radps).quadrature_a;
  }

  // The greatest driving torque at the even speed `shaft_radps`, either way; most_braking() is at least as much. Never
  // below a millionth of the holding torque, even where there is none.
  [[nodiscard]] PullOut pull_out(double shaft_radps) const;
  // The same against a load that drives the motor, at a lag the other way; searched, to 1e-6 of a radian.
  [[nodiscard]] PullOut most_braking(double shaft_radps) const;

  // The speed up to which the whole holding torque is available, at a lag of a quarter turn. Smaller lags run short of
  // voltage at lower speeds, because their current strengthens the magnet's field.
  [[nodiscard]] double corner_speed_radps() const;

  [[nodiscard]] double amplitude_a() const { return amplitude_a_; }
  // Voltages at the amplitude of the commanded current, and the back EMF per rad/s of the shaft.
  [[nodiscard]] double resistance_v() const { return resistance_ohm_ * amplitude_a_; }
  [[nodiscard]] double reactance_v(double field_radps) const {
    return inductance_per_rad_h_ * field_radps * amplitude_a_;
  }
  [[nodiscard]] double back_emf_vs() const { return torque_constant_nmpa_; }
  [[nodiscard]] double supply_v() const { return supply_v_; }

  [[nodiscard]] double copper_loss_w(const Vector& i) const { return resistance_ohm_ * i.squared(); }
  [[nodiscard]] double field_energy_j(const Vector& i) const { return 0.5 * inductance_h_ * i.squared(); }
  // Power through the terminals while the currents keep their lengths: v . i with v = (R + j w L) i + back EMF.
  [[nodiscard]] double terminal_power_w(const Vector& i, double shaft_radps, double field_radps) const {
    const double reactance = inductance_per_rad_h_ * field_radps;
    const double v_d = resistance_ohm_ * i.direct_a - reactance * i.quadrature_a;
    const double v_q = resistance_ohm_ * i.quadrature_a + reactance * i.direct_a + torque_constant_nmpa_ * shaft_radps;
    return v_d * i.direct_a + v_q * i.quadrature_a;
  }

 private:
  [[nodiscard]] Vector limited(const Vector& commanded, const Vector& needed_v, double reactance_ohm) const;

  double amplitude_a_ = 0;           // sqrt(2) rated current
  double torque_constant_nmpa_ = 0;  // K
  double resistance_ohm_ = 0;
  double inductance_h_ = 0;
  double inductance_per_rad_h_ = 0;  // N_r L: w L per rad/s of the shaft
  double supply_v_ = 0;
};

}  // namespace ballast::sim
