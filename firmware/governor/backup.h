// A robot at one state: bounds of its masses, the cone, the wish of the backup, and the command at a ramp's end.
#pragma once

#include "firmware/governor/belief.h"
#include "firmware/governor/cone.h"
#include "firmware/governor/governor_params.h"

namespace ballast::firmware {

// Steps of a moving ball cost about this many steps of a held one (tools/docs/governor.md has both).
inline constexpr int kMovingStepWork = 3;
// Declared errors of the belief are carried along.
inline int held_step_work(const GovernorParams& params) { return params.belief_error.any() ? 2 : 1; }
// A search has time for so many steps of a moving ball in GovernorParams::step_s. There are 2, near the cone's edge 4;
// twice that leaves time for longer brakes.
inline constexpr Wide kLikelySteps = 8;

[[nodiscard]] MassMotion motion_of(const RobotState& state);

// The masses where they are: behind their commands.
[[nodiscard]] MassMotion lagging(const GovernorParams& params, const RobotState& state);

// Accelerations at the end of a ramp of length h_s from state.mass_acceleration with which each mass keeps its limits:
// |u| <= max_acceleration; the velocity within max_velocity; and from the ends of its rail it stays so far that half of
// max_acceleration stops it. A mass past a limit is brought back. `spare_speed`: part of max_velocity that is kept
// free.
[[nodiscard]] Box box_of(const GovernorParams& params, const RobotState& state, int mass_count, Real h_s,
                         Real spare_speed);

// The cone at this state, with the errors that the motors of moving masses may have, and `uncertain` of N as slack.
[[nodiscard]] Cone cone_of(const GovernorParams& params, const AffineForces& forces, const RobotState& state,
                           int mass_count);

// The backup's wish: brake.
[[nodiscard]] PerMass<Real> braking(const GovernorParams& params, const RobotState& state, int mass_count);

// The masses after h_s, to first order, where they follow the nominal, or where they brake and are bent by `bend`.
void move_masses(int mass_count, Real h_s, RobotState& state);
void brake_masses(const GovernorParams& params, int mass_count, Real h_s, const PerMass<Real>& bend, RobotState& state);

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

// A stretch of time in which the commanded accelerations go linearly from `start` to the command at its end.
struct Ramp {
  PerMass<Real> start{};
  Box end;             // of the command: what the motors can reach by then
  Real h_s = 0;        // length
  Real spare = 0;      // part of the friction that the command keeps free, if it can
  bool quick = false;  // for a rollout, in which the projection may give up early
  bool swing = false;  // masses that swing in their motors' fields accelerate as they swing, not as commanded
  Real belief_n = 0;   // of the friction, and of N, that the cone keeps free for errors of the belief
};

struct GovernedRamp {
  RobotState state;     // predicted at the end, with the command in mass_acceleration
  AffineForces forces;  // there
  Cone cone;            // there, without `spare`
  Projection command;
  Vector3 force_W_n = Vector3::Zero();  // there
  Real outside_n = 0;                   // of the cone, <= 0: inside
  int steps = 0;                        // of the projection's searches
  bool with_errors = false;             // of motors or belief
  Real belief_n = 0;                    // Ramp::belief_n
};

// The cost of a projection, in steps of a rollout that is not bent: by the steps of its searches. Errors make each of
// its rounds dearer.
inline int cost_of(const GovernedRamp& ramp) {
  const int cone_steps = ramp.with_errors ? 6 : 12;  // cost as much as a step that is not bent
  return 1 + ramp.steps / cone_steps;
}

// The command at the end of a ramp that begins in `state`, where the forces are `at_start`. It keeps the cone there;
// where the start keeps it too, so does the line between, up to GovernorParams::tick_slack for a tick. The end is
// predicted by the midpoint rule.
void governed_for_ramp(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                       const AffineForces& at_start, const Ramp& ramp, const PerMass<Real>& wish, GovernedRamp& out);

// The part of N that motors and errors of estimate and belief may add to f_s - kappa N.
[[nodiscard]] Real allowance_of(const GovernorParams& params, const GovernedRamp& end, int mass_count);

// The accelerations with which a motion begins out of the hold: any jump is followed, if the cone keeps it.
[[nodiscard]] Projection governed_beginning(const BallParams& ball, const GovernorParams& params,
                                            const RobotState& state, const PerMass<Real>& wish);

[[nodiscard]] AffineForces forces_at(const BallParams& ball, const GovernorParams& params, const RobotState& state);

// The errors of the belief in this state, where the forces are `forces`. `swing`: as in Ramp.
void drift_at(const BallParams& ball, const GovernorParams& params, const RobotState& state, const AffineForces& forces,
              bool swing, Drift& out);

// The state after a control tick in which the accelerations go linearly from `start` to `end`.
[[nodiscard]] RobotState after_ramp(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                                    const PerMass<Real>& start, const PerMass<Real>& end, Real h_s);

}  // namespace ballast::firmware
