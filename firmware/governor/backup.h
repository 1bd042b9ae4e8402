// What a robot does at one state: forces, bounds of its masses, and the commands of the backup.
#pragma once

#include "firmware/governor/cone.h"
#include "firmware/governor/governor_params.h"

namespace ballast::firmware {

// Steps of a moving ball cost about this many steps of a held one (tools/docs/governor.md has both).
inline constexpr int kMovingStepWork = 5;

[[nodiscard]] MassMotion motion_of(const RobotState& state);

// Accelerations with which each mass keeps its limits: |u| <= max_acceleration; the velocity within max_velocity; and
// from the ends of its rail it stays so far that half of max_acceleration stops it. A mass past a limit is brought back
// over `within_s`.
[[nodiscard]] Box box_of(const GovernorParams& params, const RobotState& state, int mass_count, Real within_s);

// The cone at this state, with the errors that the motors of moving masses may have, and `uncertain` of N as slack.
[[nodiscard]] Cone cone_of(const GovernorParams& params, const AffineForces& forces, const RobotState& state,
                           int mass_count);

// The backup's wish: brake.
[[nodiscard]] PerMass<Real> braking(const GovernorParams& params, const RobotState& state, int mass_count);

// All masses are so slow that the brake ends.
[[nodiscard]] bool still(const GovernorParams& params, const RobotState& state, int mass_count);

// f_s / (friction N); infinite where N <= 0.
[[nodiscard]] Real use_of(Real friction, Real static_friction_n, Real normal_force_n);

// The mass swings in its motor's field slowly enough for a rollout to follow that.
[[nodiscard]] bool swings(const GovernorParams& params, std::size_t mass);

// Rate of RobotState::swing_jerk of a mass that is commanded to accelerate by `u`.
[[nodiscard]] Real swing_rate(const MotorSwing& swing, Real u, Real swing_acceleration, Real swing_jerk);

// Bounds of commands that differ from `u` by at most `change`, inside of `box` as far as they can be.
[[nodiscard]] Box near(const Box& box, const PerMass<Real>& u, const PerMass<Real>& change);

// The wished accelerations, projected, and what they do.
struct Governed {
  Projection command;
  Cone cone;
  Vector3 force_W_n = Vector3::Zero();  // of the command
  Real outside_n = 0;                   // of the cone, <= 0 up to rounding unless it is empty
  Vector3 omega_dot_B_radps2 = Vector3::Zero();
  bool swings = false;  // governed_rolling(): the force is that of masses that swing
};
// `slack_n` is added to that of cone_of().
[[nodiscard]] Governed governed(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                                const PerMass<Real>& wish, Real within_s, Real slack_n = 0);

// What the masses of a rollout do: the command lies within `change` of state.mass_acceleration, and force and
// omega_dot are those of the masses as they swing.
[[nodiscard]] Governed governed_rolling(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                                        const PerMass<Real>& wish, const PerMass<Real>& change);

// governed() for a command that is constant for a control tick: the cone holds at its end too. The state at the end is
// predicted to first order, so f_s / N may pass the cone by terms of (control_period_s)^2.
[[nodiscard]] Governed governed_for_tick(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                                         const PerMass<Real>& wish);

// A control tick in which accelerations go linearly from `start` to the command at its end.
struct Ramp {
  PerMass<Real> start{};
  Box end;  // of the command: what the motors can reach in the tick
};

struct GovernedRamp {
  Governed end;        // forces and command at the tick's end
  RobotState state;    // predicted there
  Real allowance = 0;  // part of N that the cone kept free for motors and errors, along the friction
};

// The command at the end of the tick that begins in `state`. It keeps the cone there; where the tick's start keeps it
// too, so does the line between, up to GovernorParams::tick_slack. The end is predicted by the midpoint rule.
[[nodiscard]] GovernedRamp governed_for_ramp(const BallParams& ball, const GovernorParams& params,
                                             const RobotState& state, const Ramp& ramp, const PerMass<Real>& wish);

// The state after a control tick in which the accelerations go linearly from `start` to `end`.
[[nodiscard]] RobotState after_ramp(const BallParams& ball, const RobotState& state, const PerMass<Real>& start,
                                    const PerMass<Real>& end, Real h_s);

}  // namespace ballast::firmware
