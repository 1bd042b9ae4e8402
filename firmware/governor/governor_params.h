// Parameters of the governor. Types only.
#pragma once

#include <limits>

#include "firmware/governor/robot_state.h"

namespace ballast::firmware {

// How a stepper moves its mass: rotor and mass swing about the field, which the microsteps lead on in jumps. All zero:
// the mass is where it is commanded to be.
struct MotorSwing {
  Real natural_radps = 0;  // sqrt(stiffness / inertia) of rotor and mass in the field
  Real damping_ratio = 0;  // of that
  Real microstep = 0;      // rail units
  Real full_step = 0;      // rail units
  Real step_error = 0;     // largest error of a full step, as a part of it
  Real detent = 0;         // greatest acceleration of the mass by the motor's detent torque, rail units / s^2
};

// Limits of a mass, rail units. Infinite where there is none, but max_acceleration is finite and > 0.
struct MassLimits {
  Real max_velocity = 0;
  Real max_acceleration = 0;
  Real lower_end = 0;
  Real upper_end = 0;
  MotorSwing swing;
  Real max_jerk = std::numeric_limits<Real>::infinity();  // > 0, of commands that are not the nominal's own
  // A moving mass is behind its command by this times its velocity.
  Real lag_s = 0;
  // All commands but a motion's own jumps keep this: >= max_jerk.
  Real motor_jerk = std::numeric_limits<Real>::infinity();
};

// Bounds of what is believed of the robot, of any sign.
struct BeliefErrors {
  Real mass_share = 0;        // of each mass and each of the shell's moments of inertia, as a part of it, < 1
  Real center_of_mass_m = 0;  // of each component of the shell's centre of mass

  [[nodiscard]] bool any() const { return mass_share > 0 || center_of_mass_m > 0; }
};

// The controller's parameters for the governor. Everything else follows from the robot: governor_params().
struct GovernorSettings {
  bool on = false;              // false: nothing is bent, and the rest is not read
  Real friction = 0;            // kappa > 0: f_s <= kappa N; infinite: perfect friction
  Real friction_use = 1;        // in (0, 1]: the same of a floor whose friction was measured while the ball slipped
  Real min_normal_force_n = 0;  // N >= this, >= 0
  PerMass<MotorSwing> swing{};  // all zero: the masses are where they are commanded to be
  BeliefErrors belief_error;    // all zero: the robot is as believed
};

struct GovernorParams {
  Real friction = 0;            // kappa > 0: f_s <= kappa N; infinite: perfect friction
  Real min_normal_force_n = 0;  // N >= this
  PerMass<MassLimits> mass{};
  Wide control_period_s = 0;
  // The nominal's own changes are followed, however fast: a motion without feedback. Otherwise within max_jerk.
  bool jumps = true;
  // The backup brakes each mass with u = -v / brake_time_s.
  Real brake_time_s = 0;
  // A brake ends where every mass is slower than still_velocity of it (rail units / s): from there it is stopped
  // linearly.
  PerMass<Real> still_velocity{};
  // The part of the friction that a certificate leaves unused once the masses are held. It covers the difference
  // between a certified and an executed backup: the steps of the rollout, and the state at the tick of the switch.
  Real reserve = 0;
  // The same while the masses move. A rollout that squeezes by the cone's edge would not be repeated by the robot.
  Real moving_reserve = 0;
  // Part of N that the cone keeps free for what the estimate may be off. It may be set anew before every tick,
  // from Sensitivity::share().
  Real uncertain = 0;
  // Kept free by cone and rollout.
  BeliefErrors belief_error;
  // Part of N that the cone keeps free in a tick: the force leaves the line between the tick's ends by up to a few
  // times (tick / sqrt(r / g))^2 / 8 of N.
  Real tick_slack = 0;
  Real step_s = 0;        // of a rollout
  Wide horizon_s = 0;     // a rollout ends this long after its switch
  int search_ticks = 0;   // a candidate is likely complete this many ticks after its beginning
  int stretch_ticks = 0;  // the shortest stretch of the nominal after that
  int work_per_tick = 0;  // in steps of a held ball
};

// Sets everything but friction, min_normal_force_n, mass, jumps and uncertain. mass.max_acceleration has to be set
// before. Times are multiples of sqrt(r / g), or of 1 s without gravity.
void set_times(const BallParams& ball, Wide control_period_s, GovernorParams& params);

// Ticks in which a rollout likely comes from today's state, with masses that are held meanwhile, through a motion that
// is not bent and a stop.
[[nodiscard]] int ticks_to_certify(const GovernorParams& params, Wide motion_s);

}  // namespace ballast::firmware
