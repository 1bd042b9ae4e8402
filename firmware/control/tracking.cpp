#include <cmath>

#include "firmware/control/parts.h"
#include "firmware/motion/rail_ends.h"
#include "firmware/motion/tick_motion.h"

namespace ballast::firmware {

namespace {

// The integral of the place's error is bounded by this many radii times sqrt(r / g); without gravity, times a second.
constexpr Real kMostIntegral = 2;

// A ball that is further behind its place than kMostPlaceError, along the plan's path, makes the motion's time wait. At
// twice that the rate is kLeastRate. The rate changes by at most kRateChange per sqrt(r / g).
constexpr Real kLeastRate = Real(0.25);
constexpr Real kRateChange = Real(0.1);

// A ball is calm that is slower than kCalmOmega sqrt(g / r) and less than kCalmPlace radii from its place. It rests
// after a calm of kCalm sqrt(r / g), and until it is twice as far or fast. Where that comes before kStays sqrt(r / g)
// are over, something moves it.
constexpr Real kCalmOmega = Real(0.01), kCalmPlace = Real(0.01), kCalm = 8, kStays = 80;

Real most_integral_ms(const BallParams& ball) { return kMostIntegral * ball.radius_m * unit_s(ball); }

Real bounded(Real value, Real most) { return value > most ? most : (value < -most ? -most : value); }

// The ball at the start of the tick. A sensed one has its place reckoned from the reference's first.
BallState observe(const ControllerParams& params, const ControllerState& state, const BallMotion& motion,
                  const Followed& followed, TrackingState& tracking) {
  BallState ball;
  ball.orientation = motion.orientation;
  ball.angular_velocity_B_radps = motion.angular_velocity_B_radps;
  if (params.estimation.estimated) {
    ball.position_W_m = state.estimate.position_W_m;
    return ball;
  }
  const Real radius_m = params.ball.radius_m;
  if (!tracking.reckons) {
    const Vector2 start_W_m = reference_at(followed.reference, params.ball.mass_count, radius_m, 0).position_W_m;
    begin_reckoning(start_W_m, ball, radius_m, tracking.reckoning);
    tracking.reckons = true;
  } else {
    advance_reckoning(ball, radius_m, static_cast<Real>(params.control_period_s), tracking.reckoning);
  }
  ball.position_W_m = tracking.reckoning.position_W_m;
  return ball;
}

// The motion's time at a time after the start. Its rate goes on as it is.
Wide motion_time_s(const MotionClock& clock, Wide time_s) {
  return time_s - clock.delay_s - Wide{1 - clock.rate} * (time_s - clock.seen_s);
}

// A motion at a time after its start: one that begins where the masses stand has lost its initial velocity.
ProfilePoint planned(const ControllerParams& params, const Followed& followed, int i, Wide time_s) {
  const Wide motion_s = motion_time_s(followed.clock, time_s);
  ProfilePoint point = followed.motion[at(i)].at(motion_s);
  if (followed.rebased) {
    const ProfilePoint first = followed.motion[at(i)].at(0);
    point.position += followed.origin[at(i)] - first.position - first.velocity * motion_s;
    point.velocity -= first.velocity;
  }
  // How the rate changes is known for the next ticks only.
  const bool soon = time_s <= followed.clock.seen_s + Wide(2.5) * params.control_period_s;
  const Wide rate{followed.clock.rate}, change{soon ? followed.clock.change : 0};
  if (rate == 1 && change == 0) return point;
  point.acceleration = rate * rate * point.acceleration + change * point.velocity;
  point.velocity *= rate;
  return point;
}

// How far the ball is behind its place, along the plan's path.
Real distance_behind_m(const ControllerParams& params, const ReferenceTable& table, const BallState& ball,
                       Wide motion_s) {
  const Real radius_m = params.ball.radius_m;
  const BallState reference = reference_at(table, params.ball.mass_count, radius_m, motion_s);
  const Vector2 velocity = rolling_velocity(reference.orientation, reference.angular_velocity_B_radps, radius_m);
  const Real speed = std::sqrt(velocity.dot(velocity));
  if (!(speed > 0)) return 0;
  return velocity.dot(reference.position_W_m - ball.position_W_m) / speed;
}

// Sets the rate of the motion's time from the start of the next tick on. `ball`: nullptr where it is not seen.
void advance_clock(const ControllerParams& params, const ReferenceTable& table, const BallState* ball,
                   const ErrorVector& e, Wide now_s, MotionClock& clock) {
  const Wide period_s = params.control_period_s;
  const Real most_m = kMostPlaceError * params.ball.radius_m;
  Real wanted = 1;
  if (ball != nullptr) {
    const Vector2 off = place_error(e, params.ball.mass_count);
    const bool far = off.dot(off) >= Real(0.99) * most_m * most_m;  // bounded by that
    if (far || clock.rate < 1) {
      const Real behind = distance_behind_m(params, table, *ball, motion_time_s(clock, now_s)) / most_m - 1;
      wanted = 1 - (1 - kLeastRate) * std::fmin(std::fmax(behind, Real(0)), Real(1));
    }
  }
  clock.delay_s += Wide{1 - clock.rate} * (now_s + period_s - clock.seen_s);
  clock.seen_s = now_s + period_s;
  const auto period = static_cast<Real>(period_s);
  const Real most = period * kRateChange / unit_s(params.ball);
  const Real change = wanted - clock.rate;
  const Real step = std::fmin(std::fmax(change, -most), most);
  clock.change = step / period;
  clock.rate = step == change ? wanted : clock.rate + step;
}

// The change of the motion's acceleration in the tick after this one.
Wide motion_jump(const ControllerParams& params, const Followed& followed, int i, Wide now_s) {
  const Wide period_s = params.control_period_s;
  return planned(params, followed, i, now_s + 2 * period_s).acceleration -
         planned(params, followed, i, now_s + period_s).acceleration;
}

// Keeps the tick in which a governed motion rests up to date.
void wait_for_ball(const ControllerParams& params, const BallState* ball, const ErrorVector& e, Wide now_s,
                   ControllerState& state) {
  MotionClock& clock = state.tracking.clock;
  const auto ticks = [&] { return static_cast<std::int64_t>(clock.delay_s / params.control_period_s); };
  const std::int64_t before = ticks();
  advance_clock(params, followed(params, state).reference, ball, e, now_s, clock);
  std::int64_t& end_tick = state.governing.governor.nominal_end_tick;
  if (state.governing.governs && end_tick > 0) end_tick += ticks() - before;
}

MassError mass_error(const ControllerParams& params, const PerMass<ProfilePoint>& motion, const PerMass<Real>& position,
                     const PerMass<Real>& velocity) {
  MassError masses;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    masses.position[at(i)] = static_cast<Real>(Wide{position[at(i)]} - motion[at(i)].position);
    masses.velocity[at(i)] = static_cast<Real>(Wide{velocity[at(i)]} - motion[at(i)].velocity);
  }
  return masses;
}

MassError masses_at(const ControllerParams& params, const ControllerState& state, const Followed& followed,
                    Wide time_s) {
  PerMass<ProfilePoint> motion{};
  for (int i = 0; i < params.ball.mass_count; ++i) motion[at(i)] = planned(params, followed, i, time_s);
  return mass_error(params, motion, state.now.position, state.now.velocity);
}

ErrorVector error_at(const ControllerParams& params, const ControllerState& state, const Followed& followed,
                     const BallState& ball, Wide time_s) {
  return tracking_error(followed.reference, params.ball.mass_count, params.ball.radius_m,
                        motion_time_s(followed.clock, time_s), followed.clock.rate, ball,
                        masses_at(params, state, followed, time_s), state.tracking.integral_W_ms);
}

// The errors of the masses at the end of a tick that they begin at `from`, time_s after the start: predicted as a
// certificate's rollout predicts them (Rollout::ahead()). Errors of today instead would be two ticks late, and a motion
// that is bent for long would leave the certified one.
MassError mass_error_ahead(const ControllerParams& params, const Followed& followed, const PerMass<ProfilePoint>& from,
                           Wide time_s) {
  const Wide h = params.control_period_s;
  MassError masses;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    const ProfilePoint motion = planned(params, followed, i, time_s);
    const Wide velocity = from[at(i)].velocity - motion.velocity;
    const Wide acceleration = from[at(i)].acceleration - motion.acceleration;
    masses.position[at(i)] =
        static_cast<Real>(from[at(i)].position - motion.position + h * (velocity + h * acceleration / 2));
    masses.velocity[at(i)] = static_cast<Real>(velocity + h * acceleration);
  }
  return masses;
}

// Follows the calm and the rest of a ball whose reference holds. `e`: its errors.
void watch_rest(const ControllerParams& params, const ErrorVector& e, RestState& rest) {
  const int n = params.ball.mass_count;
  const Real unit = unit_s(params.ball), tick = static_cast<Real>(params.control_period_s) / unit;
  const auto omega = at(2 * n + 3);
  const Real speed2 = (e[omega] * e[omega] + e[omega + 1] * e[omega + 1] + e[omega + 2] * e[omega + 2]) * unit * unit;
  const Vector2 off = place_error(e, n) / params.ball.radius_m;
  const Real band = rest.rests ? 2 : 1, most_speed = band * kCalmOmega, most_off = band * kCalmPlace;
  const bool calm = speed2 <= most_speed * most_speed && off.dot(off) <= most_off * most_off;
  if (!calm) {
    rest.restless |= rest.rests && static_cast<Real>(rest.ticks) * tick < kStays;
    rest.rests = false;
    rest.ticks = 0;
    rest.offset = {};
    return;
  }
  if (rest.rests) {
    if (static_cast<Real>(rest.ticks) * tick < kStays) ++rest.ticks;
    return;
  }
  if (rest.restless) return;
  ++rest.ticks;
  // The mean so far.
  for (int i = 0; i < n; ++i) rest.offset[at(i)] += (e[at(i)] - rest.offset[at(i)]) / static_cast<Real>(rest.ticks);
  rest.rests = static_cast<Real>(rest.ticks) * tick > kCalm;
  if (rest.rests) rest.ticks = 0;
}

MassError beside(MassError masses, const PerMass<Real>* offset) {
  for (std::size_t i = 0; i < masses.position.size() && offset != nullptr; ++i) masses.position[i] -= (*offset)[i];
  return masses;
}

// Without feedback a mass comes back to its motion as 1 / sqrt(g / r) allows, critically damped.
PerMass<Real> back_to_motion(const BallParams& ball, const MassError& masses) {
  const Real w = ball.gravity_mps2 > 0 ? std::sqrt(ball.gravity_mps2 / ball.radius_m) : Real(1);
  PerMass<Real> correction{};
  for (int i = 0; i < ball.mass_count; ++i) {
    correction[at(i)] = 2 * w * masses.velocity[at(i)] + w * w * masses.position[at(i)];
  }
  return correction;
}

}  // namespace

void set_origin(ControllerState& state) {
  state.tracking.rebased = state.started;
  state.tracking.origin = state.hold_position;
  state.tracking.clock = {};
}

void begin_tracking(ControllerState& state, std::int64_t next, bool feeds) {
  const bool rebased = state.tracking.rebased;
  const PerMass<Wide> origin = state.tracking.origin;
  state.tracking = {};
  state.tracking.follows = true;
  state.tracking.feeds = feeds;
  state.tracking.start_tick = next;
  state.tracking.rebased = rebased;
  state.tracking.origin = origin;
}

Followed followed(const ControllerParams& params, const ControllerState& state) {
  const TrackingState& tracking = state.tracking;
  const CourseState& course = state.course;
  const PerMass<Real>* offset = tracking.rest.rests ? &tracking.rest.offset : nullptr;
  if (course.in_force < 0) {
    return {params.motion, params.tracking, tracking.clock, tracking.rebased, tracking.origin, offset};
  }
  const Course& in_force = course.slot[at(course.in_force)];
  return {in_force.motion, in_force.reference, tracking.clock, false, tracking.origin, offset};
}

Followed coming_course(const ControllerState& state) {
  const Course& coming = state.course.coming();
  return {coming.motion, coming.reference, {}, false, state.tracking.origin};
}

ProfilePoint motion_at_course(const ControllerParams& params, const ControllerState& state, int i) {
  if (!state.tracking.follows) return {state.hold_position[at(i)], 0, 0};
  const std::int64_t ticks = minus(state.course.from_tick, state.tracking.start_tick);
  return planned(params, followed(params, state), i, static_cast<Wide>(ticks) * params.control_period_s);
}

Wish wish_at(const ControllerParams& params, const Followed& followed, const Vector2& integral_W_ms, Wide time_s,
             bool feeds, const RobotState& robot) {
  Wish wish;
  PerMass<ProfilePoint> motion{};
  for (int i = 0; i < params.ball.mass_count; ++i) {
    motion[at(i)] = planned(params, followed, i, time_s);
    wish.own[at(i)] = static_cast<Real>(motion[at(i)].acceleration);
  }
  const MassError masses = mass_error(params, motion, robot.mass_position, robot.mass_velocity);
  PerMass<Real> correction{};
  const Wide motion_s = motion_time_s(followed.clock, time_s);
  if (feeds && followed.rest_offset == nullptr && tracks_at(followed.reference, motion_s)) {
    BallState ball;
    ball.orientation = robot.orientation;
    ball.angular_velocity_B_radps = robot.angular_velocity_B_radps;
    ball.position_W_m = robot.position_W_m;
    const ErrorVector e = tracking_error(followed.reference, params.ball.mass_count, params.ball.radius_m, motion_s,
                                         followed.clock.rate, ball, masses, integral_W_ms);
    correction = feedback(followed.reference, params.ball.mass_count, motion_s, e);
  } else {
    correction = back_to_motion(params.ball, beside(masses, followed.rest_offset));
  }
  for (int i = 0; i < params.ball.mass_count; ++i) wish.u[at(i)] = wish.own[at(i)] - correction[at(i)];
  return wish;
}

Wish wish_of_active(const ControllerParams& params, const ControllerState& state, Wide time_s,
                    const RobotState& robot) {
  Wish wish;
  PerMass<ProfilePoint> motion{};
  for (int i = 0; i < params.ball.mass_count; ++i) {
    motion[at(i)] = state.active[at(i)].at(time_s);
    wish.own[at(i)] = static_cast<Real>(motion[at(i)].acceleration);
  }
  const PerMass<Real> correction =
      back_to_motion(params.ball, mass_error(params, motion, robot.mass_position, robot.mass_velocity));
  for (int i = 0; i < params.ball.mass_count; ++i) wish.u[at(i)] = wish.own[at(i)] - correction[at(i)];
  return wish;
}

// The ball is seen at the start of this tick, and the acceleration at the end of the next one follows from it.
void track(const ControllerParams& params, const Inputs& inputs, ControllerState& state, std::int64_t next) {
  TrackingState& tracking = state.tracking;
  const Wide period_s = params.control_period_s;
  std::int64_t ticks = minus(inputs.tick, tracking.start_tick);
  Wide now_s = static_cast<Wide>(ticks) * period_s;
  const bool governs = state.governing.governs;
  // In the tick of the start the ball may still be held.
  const BallMotion motion = ball_motion(params, state, inputs.sensors);
  const Followed before = followed(params, state);
  const Wide motion_s = motion_time_s(before.clock, now_s);
  const bool sees = tracking.feeds && ticks >= 0 && motion.known && tracks_at(before.reference, motion_s);
  ErrorVector e{};
  PerMass<Real> correction{};
  BallState ball;
  if (sees) {
    ball = observe(params, state, motion, before, tracking);
    e = error_at(params, state, before, ball, now_s);
    if (holds_at(before.reference, motion_s)) watch_rest(params, e, tracking.rest);
    if (!tracking.rest.rests) correction = feedback(before.reference, params.ball.mass_count, motion_s, e);
  }
  const bool returns = ticks >= 0 && (sees ? tracking.rest.rests : governs);
  // The errors of a motion and of a course that begins with the next tick are the same.
  const bool changes = state.course.stage == CourseStage::kAwaited && next == state.course.from_tick;
  if (changes) {
    put_in_force(state, next);
    ticks = -1;
    now_s = -period_s;
  }
  const Followed motion_now = followed(params, state);
  TickToGovern tick;
  tick.tick = next;
  tick.motion = motion;
  // Halts and courses begin with a ball whose masses already follow or hold.
  const bool goes_on = state.governing.halt.begun || state.course.in_force >= 0;
  tick.held = ticks < 0 && !goes_on;
  tick.place_W_m = ball.position_W_m;
  const bool sets_out = ticks < 0 && state.course.in_force >= 0 && !sees;
  if (sets_out) {
    const Real radius_m = params.ball.radius_m;
    tick.place_W_m = reference_at(motion_now.reference, params.ball.mass_count, radius_m, 0).position_W_m;
  }
  if (params.estimation.estimated) tick.place_W_m = state.estimate.position_W_m;
  if (tick.held) tick.place_W_m = params.estimation.initial_position_W_m;
  PerMass<Wide> accelerations{};
  bool saturated = false;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    ProfilePoint& from = tick.from[at(i)];
    from = commanded(params, state, next, i);
    // The masses stand, or go on at their initial velocity. A motion without feedback is followed in its own jumps.
    if (tick.held) from.acceleration = tracking.feeds ? 0 : planned(params, motion_now, i, 0).acceleration;
  }
  if (governs && motion.known && tick.held) bend_beginning(params, state, tick);
  if (returns) {
    const MassError masses = mass_error_ahead(params, motion_now, tick.from, now_s + period_s);
    correction = back_to_motion(params.ball, beside(masses, motion_now.rest_offset));
  }
  const bool halting = governs && motion.known && halts(state.governing, next);
  HaltWish halt;
  if (halting) {
    halt = wish_of_halt(params, state, tick);
    state.governing.halt.wish = halt.wish;
  }
  for (int i = 0; i < params.ball.mass_count; ++i) {
    const ProfilePoint& from = tick.from[at(i)];
    const Wide motion_next = planned(params, motion_now, i, now_s + 2 * period_s).acceleration;
    const Wide wanted = halting ? Wide{halt.wish[at(i)]} : motion_next - Wide{correction[at(i)]};
    MotionLimits limits = motion_limits(params, i);
    const Wide jump = halting ? Wide{halt.change[at(i)]} : motion_jump(params, motion_now, i, now_s);
    if (!tracking.feeds && !halting) limits.max_jerk = std::fmax(limits.max_jerk, std::fabs(jump) / period_s);
    const RailEnds ends = rail_ends(params.ball, i);
    const Wide swing = params.motor[at(i)].swing;
    const auto reachable = [&](Wide acceleration) {
      return reachable_acceleration(from, acceleration, limits, ends.lower + swing, ends.upper - swing, period_s);
    };
    Wide reached = reachable(wanted);
    tick.wanted[at(i)] = wanted;
    if (governs) {
      const Wide change = governed_jerk(state.governing, i, jump, period_s) * period_s;
      tick.lowest[at(i)] = reachable(from.acceleration - change);
      tick.highest[at(i)] = reachable(from.acceleration + change);
      reached = std::fmin(std::fmax(reached, tick.lowest[at(i)]), tick.highest[at(i)]);
    }
    constexpr Wide kSaturated =
        0.05;  // of the greatest acceleration: more than the jerk limit takes off a plan's jumps
    saturated = saturated || !(std::fabs(reached - wanted) <= kSaturated * limits.max_acceleration);
    accelerations[at(i)] = reached;
  }
  if (governs && motion.known) govern_tick(params, tick, state, accelerations);
  for (int i = 0; i < params.ball.mass_count; ++i) {
    if (!set_tick_motion(tick.from[at(i)], accelerations[at(i)], period_s, state.active[at(i)])) {
      state.faults |= bit(Fault::kInternal);
    }
  }
  state.start_tick = next;
  if (tracking.feeds && ticks >= 0 && !halting) wait_for_ball(params, sees ? &ball : nullptr, e, now_s, state);
  if (!sees || tracking.rest.rests || halting || saturated || (governs && state.governing.report.bent)) return;
  const Vector2 off = place_error(e, params.ball.mass_count);
  const Real most = most_integral_ms(params.ball);
  for (int j = 0; j < 2; ++j) {
    tracking.integral_W_ms[j] = bounded(tracking.integral_W_ms[j] + static_cast<Real>(period_s) * off[j], most);
  }
}

}  // namespace ballast::firmware
