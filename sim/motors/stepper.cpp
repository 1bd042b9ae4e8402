#include "sim/motors/stepper.h"

#include <algorithm>
#include <numbers>

#include "sim/motors/random.h"

namespace ballast::sim {

namespace {

constexpr double kPi = std::numbers::pi;

}  // namespace

Stepper::Stepper(const Motor& motor, double initial_shaft_rad, std::uint64_t tooth_seed)
    : motor_(motor),
      phases_(motor.has_winding() ? PhaseCurrent(motor) : PhaseCurrent()),
      teeth_(motor.rotor_teeth()),
      initial_shaft_rad_(initial_shaft_rad) {
  const double full_step_rad = 2 * kPi / motor.steps_per_revolution;
  tooth_error_rad_.resize(static_cast<std::size_t>(motor.steps_per_revolution));
  for (double& error : tooth_error_rad_) error = motor.step_error * full_step_rad * (2 * uniform(tooth_seed) - 1);
  update_field();
}

void Stepper::balance(double torque_nm, double shaft_radps) {
  field_radps_ = shaft_radps;
  const double field_torque_nm = torque_nm + motor_.viscous_damping_nms * shaft_radps +
                                 motor_.detent_torque_nm * std::sin(4 * teeth_ * initial_shaft_rad_);
  offset_rad_ = balanced_lag_rad(field_torque_nm, shaft_radps) / teeth_;
  if (shaft_radps != 0) {
    // At t = 0 an even motion is midway between two pulses.
    stepped_s_ = -0.5 * microstep_rad() / std::abs(shaft_radps);
    stepped_ = shaft_radps > 0 ? 1 : -1;
  }
  update_field();
}

// The lag at which the field gives a torque at a speed, on the branch that holds the rotor.
double Stepper::balanced_lag_rad(double torque_nm, double shaft_radps) const {
  if (!motor_.has_winding() || shaft_radps == 0) {
    return std::asin(std::clamp(torque_nm / available_torque_nm(shaft_radps), -1.0, 1.0));
  }
  const double driving = phases_.pull_out(shaft_radps).lag_rad;
  double low = shaft_radps > 0 ? -kPi / 2 : -driving, high = shaft_radps > 0 ? driving : kPi / 2;
  for (int k = 0; k < 100; ++k) {
    const double middle = (low + high) / 2;
    (phases_.torque_nm(middle, shaft_radps, shaft_radps) < torque_nm ? low : high) = middle;
  }
  return (low + high) / 2;
}

void Stepper::step(int direction, double time_s) {
  if (to_swallow_ > 0) {
    --to_swallow_;
    missed_steps_ += direction;
    return;
  }
  missed_steps_ += direction - direction * direction_;
  direction *= direction_;
  position_steps_ += direction;
  const double since_s = time_s - stepped_s_;
  // Steps at one instant are one longer step, so they do not determine the speed.
  if (since_s > 0) field_radps_ = direction == stepped_ ? direction * microstep_rad() / since_s : 0;
  stepped_s_ = time_s;
  stepped_ = direction;
  update_field();
}

bool Stepper::wait(double time_s) {
  const double fastest_radps = microstep_rad() / (time_s - stepped_s_);
  if (!(std::abs(field_radps_) > fastest_radps)) return false;
  field_radps_ = std::copysign(fastest_radps, field_radps_);
  return motor_.has_winding();
}

double Stepper::microstep_rad() const {
  return 2 * kPi / (static_cast<double>(motor_.steps_per_revolution) * motor_.microsteps);
}

void Stepper::update_field() {
  const auto floor_div = [](std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); };
  const auto error_at = [&](std::int64_t full_step) {
    const std::int64_t count = motor_.steps_per_revolution;
    return tooth_error_rad_[static_cast<std::size_t>(full_step - floor_div(full_step, count) * count)];
  };
  // Between two full steps the microsteps share the error linearly; it is counted from where the rotor stood at t = 0.
  const std::int64_t full = floor_div(position_steps_, motor_.microsteps);
  const double part = static_cast<double>(position_steps_ - full * motor_.microsteps) / motor_.microsteps;
  const double error = (1 - part) * error_at(full) + part * error_at(full + 1) - error_at(0);
  field_rad_ = initial_shaft_rad_ + offset_rad_ + static_cast<double>(position_steps_) * microstep_rad() + error;
}

const PhaseCurrent::PullOut& Stepper::greatest_torque(bool brakes) const {
  PhaseCurrent::PullOut& most = brakes ? most_braking_ : most_driving_;
  double& at_radps = brakes ? most_braking_at_radps_ : most_driving_at_radps_;
  if (at_radps != field_radps_) {
    most = brakes ? phases_.most_braking(field_radps_) : phases_.pull_out(field_radps_);
    at_radps = field_radps_;
  }
  return most;
}

double Stepper::torque_margin(double shaft_rad, double shaft_radps) const {
  const double lag = lag_rad(shaft_rad) - 2 * kPi * static_cast<double>(slipped_teeth_);
  if (!motor_.has_winding()) {
    return std::abs(lag) <= kPi / 2 ? 1 - std::sin(std::abs(lag)) : std::sin(std::abs(lag)) - 1;
  }
  const bool brakes = lag * field_radps_ < 0;
  const PhaseCurrent::PullOut& most = greatest_torque(brakes);
  const double used = std::abs(phases_.torque_nm(lag, shaft_radps, field_radps_)) / most.torque_nm;
  return std::abs(lag) <= most.lag_rad ? std::max(1 - used, -1.0) : std::min(used, 1.0) - 1;
}

double Stepper::steps_behind(double shaft_rad) const {
  return static_cast<double>(position_steps_ + missed_steps_) - (shaft_rad - initial_shaft_rad_) / microstep_rad();
}

void Stepper::count_slips(double shaft_rad) {
  const auto teeth = static_cast<std::int64_t>(std::llround(lag_rad(shaft_rad) / (2 * kPi)));
  slips_ += std::abs(teeth - slipped_teeth_);
  slipped_teeth_ = teeth;
}

}  // namespace ballast::sim
