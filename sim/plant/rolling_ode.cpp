#include "sim/plant/rolling_ode.h"

#include <algorithm>
#include <complex>

namespace ballast::sim {

namespace {

// Its square underflows against 1, and 1e-100 times the largest numbers of the equations does not overflow.
constexpr double kComplexStep = 1e-100;

template <class T>
std::array<T, 4> unit(const T* q) {
  using std::sqrt;
  const T inverse = 1. / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {inverse * q[0], inverse * q[1], inverse * q[2], inverse * q[3]};
}

template <class T>
void rates(const Body& body, double time_s, const CarriedMasses& masses, const T* y, T* dydt) {
  const std::array<T, 4> q = unit(y + RollingOde::kQ);
  MotionOf<T> motion;
  rolling_prescribed(body, time_s, q.data(), y + RollingOde::kOmega, masses, motion);
  quaternion_rate(y + RollingOde::kQ, y + RollingOde::kOmega, dydt + RollingOde::kQ);
  for (int j = 0; j < 3; ++j) dydt[RollingOde::kOmega + j] = motion.angular_acceleration_B_radps2[j];
  for (int j = 0; j < 2; ++j) dydt[RollingOde::kZ + j] = motion.rolling_velocity_W_mps[j];
}

}  // namespace

RollingOde::RollingOde(const World& world) : body_(world), motion_(world.masses) {
  const auto& initial = world.initial;
  initial_[kQ] = initial.orientation.w();
  for (int j = 0; j < 3; ++j) {
    initial_[kQ + 1 + j] = initial.orientation.vec()[j];
    initial_[kOmega + j] = initial.angular_velocity_B_radps[j];
  }
  for (int j = 0; j < 2; ++j) initial_[kZ + j] = initial.position_W_m[j];
  begin(0);
}

RollingOde::State RollingOde::initial_state() const { return initial_; }

void RollingOde::begin(double time_s) {
  if (time_s < begin_s_) motion_.restart();
  begin_s_ = time_s;
  motion_.enter_pieces(time_s);
  end_s_ = std::min(body_.external_force.next_kink_s(time_s), motion_.smooth_until_s(time_s));
}

CarriedMasses RollingOde::carried(double time_s) const {
  const MassPoint p = masses(time_s);
  CarriedMasses out;
  carry_along(body_, p.position.data(), p.velocity.data(), p.acceleration.data(), out);
  return out;
}

template <class T>
void RollingOde::derivative(double time_s, const T* y, T* dydt) const {
  rates(body_, time_s, carried(time_s), y, dydt);
}
template void RollingOde::derivative(double, const double*, double*) const;
template void RollingOde::derivative(double, const std::complex<double>*, std::complex<double>*) const;

void RollingOde::jacobian(double time_s, const double* y, double* out) const {
  using Complex = std::complex<double>;
  const CarriedMasses masses = carried(time_s);
  std::array<Complex, kSize> at, rate;
  std::copy_n(y, kSize, at.begin());
  std::fill_n(out, kSize * kSize, 0.0);
  for (std::size_t k = 0; k < kZ; ++k) {  // nothing depends on z
    at[k] += Complex(0, kComplexStep);
    rates(body_, time_s, masses, at.data(), rate.data());
    at[k] = y[k];
    for (std::size_t i = 0; i < kSize; ++i) out[i + kSize * k] = rate[i].imag() / kComplexStep;
  }
}

}  // namespace ballast::sim
