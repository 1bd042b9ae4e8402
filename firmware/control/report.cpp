// The status of a tick.
#include <limits>

#include "firmware/control/controller.h"
#include "firmware/control/parts.h"
#include "firmware/model/rolling.h"

namespace ballast::firmware {

namespace {

// Computes N and f_s at the start of this tick. Where the ball's motion is not known, neither are they.
void compute_forces(const ControllerParams& params, const BallMotion& ball, const MassMotion& masses,
                    ControllerStatus& status) {
  constexpr Real kUnknown = std::numeric_limits<Real>::quiet_NaN();
  RollingForces& f = status.predicted;
  if (ball.known) {
    f = rolling_forces(params.ball, ball.orientation, ball.angular_velocity_B_radps, masses);
  } else {
    f.angular_acceleration_B_radps2 = Vector3(kUnknown, kUnknown, kUnknown);
    f.normal_force_n = kUnknown;
    f.friction_force_W_n = Vector2(kUnknown, kUnknown);
    f.static_friction_n = kUnknown;
  }
  friction_use(f, params.static_friction, status.mu_required, status.margin);
}

GovernorStatus governor_status(const GoverningState& governing) {
  if (!governing.governs) return {};
  const GovernorReport& report = governing.report;
  return {true, report.bent, report.backup, report.backup_margin, report.backup_until_tick, report.allowance};
}

HaltStatus halt_status(const ControllerState& state) {
  const HaltState& halt = state.governing.halt;
  const StartSearch& start = state.governing.start;
  // A halt that waits is said once it is certified.
  const bool waits = !halt.begun && start.what == Begins::kHalt;
  if (waits && (state.mode != Mode::kHalting || start.stage != StartStage::kCertified)) return {};
  const HaltPrediction& result = halt.rollout.result();
  if (!halt.asked || !halt.predicts || !result.complete || !result.rests) return {};
  return {true, halt.predicted_tick, result.distance_m, result.time_s};
}

// At whose start the motion under way began.
std::int64_t motion_tick(const ControllerState& state) {
  if (state.course.number_in_force != 0) return state.course.tick_in_force;
  if (state.mode != Mode::kRunning) return 0;
  return state.tracking.follows ? state.tracking.start_tick : state.start_tick;
}

}  // namespace

void report(const ControllerParams& params, const ControllerState& state, const Inputs& inputs,
            ControllerStatus& status) {
  const BallMotion ball = ball_motion(params, state, inputs.sensors);
  compute_forces(params, ball, state.now, status);
  status.tick = inputs.tick;
  status.scenario_id = params.scenario_id;
  status.mode = state.mode;
  status.at_rest = state.at_rest;
  status.faults = state.faults;
  status.motor_count = params.ball.mass_count;
  status.commanded_position = state.now.position;
  status.commanded_velocity = state.now.velocity;
  const std::int64_t next = plus(inputs.tick, 1);
  for (int i = 0; i < params.ball.mass_count; ++i) status.next[at(i)] = commanded(params, state, next, i);
  status.steps_issued = state.steps_issued;
  status.overload = state.overload;
  status.operator_commands = state.operator_commands;
  status.refusal = state.refusal;
  status.planned = state.planned;
  status.plan_tick = state.plan_tick;
  status.plan = state.plan;
  // Invalid values are published as fixed numbers.
  status.estimate = params.estimation.estimated && ball.known ? state.estimate : Estimate{};
  status.governor = governor_status(state.governing);
  status.halt = halt_status(state);
  status.motion_delay_s = state.tracking.follows ? state.tracking.clock.delay_s : 0;
  const CourseState& course = state.course;
  const bool comes = course.stage != CourseStage::kNone;
  status.course = {course.number_in_force, motion_tick(state), comes ? course.number : 0};
  status.slip_friction = state.slip_friction.least;
  status.measured = state.measured.valid ? state.measured : MeasuredContact{};
}

}  // namespace ballast::firmware
