// A hybrid stepper with current control: PHYSICS.md section 5. Angles and torques at the motor shaft.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "sim/scenario.h"

namespace ballast::sim {

class Stepper {
 public:
  // At t = 0 the rotor stands at initial_shaft_rad; `tooth_seed` draws the fixed pattern of full-step errors.
  Stepper(const Motor& motor, double initial_shaft_rad, std::uint64_t tooth_seed);

  // Sets the field so that torque_nm() at t = 0 is torque_nm, as if the motor had been homed under that load. What is
  // more than the holding torque cannot be held: the field then leads by the angle of greatest torque.
  void balance(double torque_nm, double shaft_radps);

  // One microstep of the field; direction +1 or -1.
  void step(int direction);

  // Electromagnetic, detent and viscous torque on the rotor.
  [[nodiscard]] double torque_nm(double shaft_rad, double shaft_radps) const {
    const double detent = motor_.detent_torque_nm == 0 ? 0 : motor_.detent_torque_nm * std::sin(4 * teeth_ * shaft_rad);
    return available_torque_nm(shaft_radps) * std::sin(teeth_ * (field_rad_ - shaft_rad)) - detent -
           motor_.viscous_damping_nms * shaft_radps;
  }

  // tau_hold: constant up to the corner speed, then falling as corner / speed (constant power).
  [[nodiscard]] double available_torque_nm(double shaft_radps) const {
    const double speed = std::abs(shaft_radps);
    return speed <= motor_.corner_speed_radps ? motor_.holding_torque_nm
                                              : motor_.holding_torque_nm * motor_.corner_speed_radps / speed;
  }

  // Part of the available torque the rotor's lag leaves unused: 1 - |sin(lag)|; below 0 once it is past the greatest
  // torque.
  [[nodiscard]] double torque_margin(double shaft_rad) const;

  // To be called as the rotor moves: past half a tooth pitch of lag it has slipped into another tooth. Counts lost
  // microsteps.
  void count_slips(double shaft_rad);

  [[nodiscard]] std::int64_t lost_steps() const { return lost_steps_; }

 private:
  void update_field();

  Motor motor_;
  double teeth_;  // N_r
  double initial_shaft_rad_;
  double offset_rad_ = 0;            // field minus rotor at t = 0
  double field_rad_;                 // phi_cmd
  std::int64_t position_steps_ = 0;  // microsteps commanded
  std::int64_t slipped_teeth_ = 0;
  std::int64_t lost_steps_ = 0;
  std::vector<double> tooth_error_rad_;  // per full step of a revolution
};

}  // namespace ballast::sim
