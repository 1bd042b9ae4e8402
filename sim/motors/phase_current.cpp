#include "sim/motors/phase_current.h"

#include <algorithm>
#include <numbers>

namespace ballast::sim {

namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kLeastTorque = 1e-6;  // part of the holding torque

}  // namespace

PhaseCurrent::PhaseCurrent(const Motor& motor)
    : amplitude_a_(std::numbers::sqrt2 * motor.rated_current_a),
      torque_constant_nmpa_(motor.holding_torque_nm / amplitude_a_),
      resistance_ohm_(motor.resistance_ohm),
      inductance_h_(motor.inductance_h),
      inductance_per_rad_h_(motor.rotor_teeth() * motor.inductance_h),
      supply_v_(motor.supply_voltage_v) {}

// i = i_ref - s u with the voltage V u: (Z i_ref + e) = (V + Z s) u, and u has length 1, so |V + Z s| = |Z i_ref + e|
// gives s > 0, and then u. All as complex numbers d + j q, Z = R + j X.
PhaseCurrent::Vector PhaseCurrent::limited(const Vector& commanded, const Vector& needed_v, double x) const {
  const double r = resistance_ohm_, v = supply_v_, z2 = r * r + x * x;
  const double excess = needed_v.squared() - v * v;
  const double s = excess / (v * r + std::sqrt(v * v * r * r + z2 * excess));
  const double along = v + r * s, across = x * s;  // V + Z s
  const double part = s / (along * along + across * across);
  return {commanded.direct_a - part * (needed_v.direct_a * along + needed_v.quadrature_a * across),
          commanded.quadrature_a - part * (needed_v.quadrature_a * along - needed_v.direct_a * across)};
}

// The greatest i_q with |i| <= I and |Z i + e| <= V lies at the top of the circle of currents, at the top of the circle
// of voltages, or where the two cross.
PhaseCurrent::PullOut PhaseCurrent::pull_out(double shaft_radps) const {
  const double speed = std::abs(shaft_radps);
  const double r = resistance_ohm_, x = inductance_per_rad_h_ * speed, e = torque_constant_nmpa_ * speed;
  const double amplitude = amplitude_a_, v = supply_v_, z = std::hypot(r, x);
  const auto found = [&](double quadrature_a, double lag_rad) {
    return PullOut{torque_constant_nmpa_ * std::max(quadrature_a, kLeastTorque * amplitude), lag_rad};
  };
  if (std::hypot(r * amplitude + e, x * amplitude) <= v) return found(amplitude, kPi / 2);

  // The top of the circle of voltages, whose centre is -e / Z and radius V / |Z|. Its voltage is V u, and the commanded
  // current for it lies along u on the circle of currents.
  const Vector top{-e * x / (z * z), -e * r / (z * z) + v / z};
  const double left2 = amplitude * amplitude - top.squared();
  if (left2 >= 0) {
    const Vector u{(r * top.direct_a - x * top.quadrature_a) / v, (r * top.quadrature_a + x * top.direct_a + e) / v};
    const double along = top.direct_a * u.direct_a + top.quadrature_a * u.quadrature_a;
    const double s = -along + std::sqrt(along * along + left2);
    return found(top.quadrature_a, std::atan2(top.quadrature_a + s * u.quadrature_a, top.direct_a + s * u.direct_a));
  }
  const double cosine = (v * v - e * e - z * z * amplitude * amplitude) / (2 * e * z * amplitude);
  if (cosine < -1) return found(0, kPi / 2);
  const double middle = std::atan2(r, x), aside = std::acos(std::min(cosine, 1.0));
  const double lag = std::sin(middle + aside) > std::sin(middle - aside) ? middle + aside : middle - aside;
  return found(amplitude * std::sin(lag), lag);
}

PhaseCurrent::PullOut PhaseCurrent::most_braking(double shaft_radps) const {
  const double speed = std::abs(shaft_radps);
  const auto torque = [&](double lag_rad) { return -torque_nm(-lag_rad, speed, speed); };
  if (speed <= corner_speed_radps()) return {torque_constant_nmpa_ * amplitude_a_, kPi / 2};
  // The torque rises to one maximum and falls, so golden section finds it.
  constexpr double kGolden = 0.6180339887498949;
  double low = 0, high = kPi;
  for (int k = 0; k < 32; ++k) {
    const double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
    (torque(a) < torque(b) ? low : high) = torque(a) < torque(b) ? a : b;
  }
  const double lag = (low + high) / 2;
  return {std::max(torque(lag), kLeastTorque * torque_constant_nmpa_ * amplitude_a_), lag};
}

// (R I + K speed)^2 + (N_r L I speed)^2 = V^2.
double PhaseCurrent::corner_speed_radps() const {
  const double ri = resistance_ohm_ * amplitude_a_, k = torque_constant_nmpa_;
  const double xi = inductance_per_rad_h_ * amplitude_a_;
  const double left2 = (supply_v_ - ri) * (supply_v_ + ri);
  return left2 / (k * ri + std::sqrt(k * k * ri * ri + (k * k + xi * xi) * left2));
}

}  // namespace ballast::sim
