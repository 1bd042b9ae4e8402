#include <cmath>

#include "firmware/control/parts.h"
#include "firmware/motion/rail_ends.h"
#include "firmware/motion/tick_motion.h"

namespace ballast::firmware {

namespace {

// The integral of the place's error is bounded by this many radii times sqrt(r / g); without gravity, times a second.
constexpr Real kMostIntegral = 2;

Real most_integral_ms(const BallParams& ball) {
  const Real time_s = ball.gravity_mps2 > 0 ? std::sqrt(ball.radius_m / ball.gravity_mps2) : Real(1);
  return kMostIntegral * ball.radius_m * time_s;
}

Real bounded(Real value, Real most) { return value > most ? most : (value < -most ? -most : value); }

// The ball at the start of the tick. A sensed one has its place reckoned from the reference's first.
BallState observe(const ControllerParams& params, const ControllerState& state, const BallMotion& motion, bool first,
                  TrackingState& tracking) {
  BallState ball;
  ball.orientation = motion.orientation;
  ball.angular_velocity_B_radps = motion.angular_velocity_B_radps;
  if (params.estimation.estimated) {
    ball.position_W_m = state.estimate.position_W_m;
    return ball;
  }
  const Real radius_m = params.ball.radius_m;
  if (first) {
    const Vector2 start_W_m = reference_at(params.tracking, params.ball.mass_count, radius_m, 0).position_W_m;
    begin_reckoning(start_W_m, ball, radius_m, tracking.reckoning);
  } else {
    advance_reckoning(ball, radius_m, static_cast<Real>(params.control_period_s), tracking.reckoning);
  }
  ball.position_W_m = tracking.reckoning.position_W_m;
  return ball;
}

ErrorVector error_at(const ControllerParams& params, const ControllerState& state, const BallState& ball, Wide time_s) {
  MassError masses;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    const ProfilePoint planned = params.motion[at(i)].at(time_s);
    masses.position[at(i)] = static_cast<Real>(Wide{state.now.position[at(i)]} - planned.position);
    masses.velocity[at(i)] = static_cast<Real>(Wide{state.now.velocity[at(i)]} - planned.velocity);
  }
  return tracking_error(params.tracking, params.ball.mass_count, params.ball.radius_m, time_s, ball, masses,
                        state.tracking.integral_W_ms);
}

}  // namespace

void begin_tracking(ControllerState& state, std::int64_t next) {
  state.tracking = {};
  state.tracking.follows = true;
  state.tracking.start_tick = next;
}

// The ball is seen at the start of this tick, and the acceleration at the end of the next one follows from it.
void track(const ControllerParams& params, const Inputs& inputs, ControllerState& state, std::int64_t next) {
  TrackingState& tracking = state.tracking;
  const Wide period_s = params.control_period_s;
  const std::int64_t ticks = minus(inputs.tick, tracking.start_tick);
  const Wide now_s = static_cast<Wide>(ticks) * period_s;
  // In the tick of the start the ball may still be held.
  const BallMotion motion = ball_motion(params, state, inputs.sensors);
  const bool sees = ticks >= 0 && motion.known && tracks_at(params.tracking, now_s);
  ErrorVector e{};
  PerMass<Real> correction{};
  if (sees) {
    const BallState ball = observe(params, state, motion, ticks == 0, tracking);
    e = error_at(params, state, ball, now_s);
    correction = feedback(params.tracking, params.ball.mass_count, now_s, e);
  }

  bool saturated = false;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    ProfilePoint from = commanded(params, state, next, i);
    if (ticks < 0) from.acceleration = 0;  // the masses stand, or go on at their initial velocity
    const Wide wanted = params.motion[at(i)].at(now_s + 2 * period_s).acceleration - Wide{correction[at(i)]};
    const MotionLimits limits = motion_limits(params, i);
    const RailEnds ends = rail_ends(params.ball, i);
    const Wide swing = params.motor[at(i)].swing;
    const Wide reached = reachable_acceleration(from, wanted, limits, ends.lower + swing, ends.upper - swing, period_s);
    constexpr Wide kSaturated =
        0.05;  // of the greatest acceleration: more than the jerk limit takes off a plan's jumps
    saturated = saturated || !(std::fabs(reached - wanted) <= kSaturated * limits.max_acceleration);
    if (!set_tick_motion(from, reached, period_s, state.active[at(i)])) state.faults |= bit(Fault::kInternal);
  }
  state.start_tick = next;
  if (!sees || saturated) return;
  const Vector2 off = place_error(e, params.ball.mass_count);
  const Real most = most_integral_ms(params.ball);
  for (int j = 0; j < 2; ++j) {
    tracking.integral_W_ms[j] = bounded(tracking.integral_W_ms[j] + static_cast<Real>(period_s) * off[j], most);
  }
}

}  // namespace ballast::firmware
