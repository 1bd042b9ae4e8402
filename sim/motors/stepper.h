// A hybrid stepper with current control: physics.md section 5. Angles and torques are those of the motor shaft. A motor
// with a winding has the torque of its currents (phase_current.h), which is tau_hold sin(lag) as long as the supply can
// drive them. Without a winding, tau_hold falls above the corner speed as corner / speed.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <vector>

#include "firmware/model/sin_cos.h"
#include "sim/motors/motor.h"
#include "sim/motors/phase_current.h"

namespace ballast::sim {

class Stepper {
 public:
  // At t = 0 the rotor stands at initial_shaft_rad; `tooth_seed` draws the fixed pattern of full-step errors.
  Stepper(const Motor& motor, double initial_shaft_rad, std::uint64_t tooth_seed);

  [[nodiscard]] const Motor& motor() const { return motor_; }
  // The field's commanded angle and mean speed.
  [[nodiscard]] double field_rad() const { return field_rad_; }
  [[nodiscard]] double field_radps() const { return field_radps_; }
  // Whether both coils have their whole current.
  [[nodiscard]] bool sound() const { return powered_ && coil_part_ == 1; }

  // Sets the field so that torque_nm() at t = 0 is torque_nm, as if the motor had been homed under that load. A load
  // beyond the holding torque cannot be held; the field then leads by the angle of greatest torque.
  void balance(double torque_nm, double shaft_radps);

  // One microstep of the field at time_s; direction +1 or -1.
  void step(int direction, double time_s);

  // --- injected faults; each holds from now on ---
  // Whether the windings have current. Without it, pulses still turn the commanded field, which gives no torque.
  void power(bool on) { powered_ = on; }
  // One of the two coils has this part of its current. Two coils at a right angle with currents cos a and k sin a make
  // a field that turns with (1 + k) / 2 and one that turns against it with (k - 1) / 2: physics.md section 5. With a
  // winding, the second field's torque is what the speed leaves available, and the energies are those of a whole coil.
  void weaken_coil(double part) { coil_part_ = part; }
  void reverse(bool on) { direction_ = on ? -1 : 1; }
  // The driver misses this many pulses.
  void swallow(std::int64_t pulses) { to_swallow_ += pulses; }

  // Slows the field if it has waited longer than between its last two steps. To be called once per tick or more often.
  // True: the torque may have changed.
  bool wait(double time_s);

  // Electromagnetic, detent and viscous torque on the rotor.
  [[nodiscard]] double torque_nm(double shaft_rad, double shaft_radps) const {
    const double detent =
        motor_.detent_torque_nm == 0 ? 0 : motor_.detent_torque_nm * firmware::sin_cos(4 * teeth_ * shaft_rad).sin;
    return field_torque_nm(shaft_rad, shaft_radps) - detent - motor_.viscous_damping_nms * shaft_radps;
  }

  // tau_hold, the greatest torque of the field at this speed.
  [[nodiscard]] double available_torque_nm(double shaft_radps) const {
    const double speed = std::abs(shaft_radps);
    if (speed <= motor_.corner_speed_radps) return motor_.holding_torque_nm;
    return motor_.has_winding() ? phases_.pull_out(speed).torque_nm
                                : motor_.holding_torque_nm * motor_.corner_speed_radps / speed;
  }

  // The part of the torque available at the field's speed that the rotor's lag leaves unused: 1 - |sin(lag)|, or with a
  // winding the same by its currents. Below 0 once the lag is past the greatest torque.
  [[nodiscard]] double torque_margin(double shaft_rad, double shaft_radps) const;

  // The winding's current now, and the power through its terminals; 0 without a winding.
  [[nodiscard]] PhaseCurrent::Vector current(double shaft_rad, double shaft_radps) const {
    return motor_.has_winding() && powered_ ? phases_.at(lag_rad(shaft_rad), shaft_radps, field_radps_)
                                            : PhaseCurrent::Vector{};
  }
  [[nodiscard]] double terminal_power_w(const PhaseCurrent::Vector& current, double shaft_radps) const {
    return phases_.terminal_power_w(current, shaft_radps, field_radps_);
  }
  [[nodiscard]] const PhaseCurrent& phases() const { return phases_; }
  [[nodiscard]] double detent_energy_j(double shaft_rad) const {
    return -motor_.detent_torque_nm / (4 * teeth_) * std::cos(4 * teeth_ * shaft_rad);
  }

  // Counts a slip into another tooth once the lag is past half a tooth pitch. To be called as the rotor moves.
  void count_slips(double shaft_rad);

  // Microsteps lost: by the teeth between the rotor and the tooth it was to follow, and by pulses that did not move the
  // field as commanded. Steps that the rotor has slipped back are not lost.
  [[nodiscard]] std::int64_t lost_steps() const {
    return std::abs(slipped_teeth_ * 4 * motor_.microsteps + missed_steps_);
  }
  [[nodiscard]] std::int64_t slips() const { return slips_; }  // teeth, in both directions

  // Microsteps by which the rotor is behind its commands since t = 0: the lag under load and the lost steps.
  [[nodiscard]] double steps_behind(double shaft_rad) const;

 private:
  void update_field();
  [[nodiscard]] const PhaseCurrent::PullOut& greatest_torque(bool brakes) const;
  [[nodiscard]] double microstep_rad() const;
  [[nodiscard]] double balanced_lag_rad(double torque_nm, double shaft_radps) const;
  [[nodiscard]] double lag_rad(double shaft_rad) const { return teeth_ * (field_rad_ - shaft_rad); }
  [[nodiscard]] double field_torque_nm(double shaft_rad, double shaft_radps) const {
    if (!powered_) return 0;
    const double lag = lag_rad(shaft_rad);
    const double whole = motor_.has_winding() ? phases_.torque_nm(lag, shaft_radps, field_radps_)
                                              : available_torque_nm(shaft_radps) * firmware::sin_cos(lag).sin;
    if (coil_part_ == 1) return whole;
    const double against = available_torque_nm(shaft_radps) * std::sin(teeth_ * (field_rad_ + shaft_rad));
    return (1 + coil_part_) / 2 * whole + (coil_part_ - 1) / 2 * against;
  }

  Motor motor_;
  PhaseCurrent phases_;
  double teeth_;  // N_r
  double initial_shaft_rad_;
  double offset_rad_ = 0;   // field minus rotor at t = 0
  double field_rad_;        // phi_cmd
  double field_radps_ = 0;  // its mean speed, from the time between its last two steps
  // The greatest torques at the field's speed, and the speed that they were last computed for.
  mutable PhaseCurrent::PullOut most_driving_{}, most_braking_{};
  mutable double most_driving_at_radps_ = std::numeric_limits<double>::quiet_NaN(),
                 most_braking_at_radps_ = std::numeric_limits<double>::quiet_NaN();
  double stepped_s_ = -std::numeric_limits<double>::infinity();  // when it last stepped
  int stepped_ = 0;                                              // direction of that step
  std::int64_t position_steps_ = 0;                              // microsteps the field has made
  std::int64_t missed_steps_ = 0;                                // commanded minus made
  bool powered_ = true;
  double coil_part_ = 1;
  int direction_ = 1;
  std::int64_t to_swallow_ = 0;
  std::int64_t slipped_teeth_ = 0;
  std::int64_t slips_ = 0;
  std::vector<double> tooth_error_rad_;  // per full step of a revolution
};

}  // namespace ballast::sim
