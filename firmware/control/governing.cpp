// The governor's part of a control tick: it bends the wished accelerations, and certifies a start.
#include <cmath>
#include <limits>

#include "firmware/control/parts.h"
#include "firmware/control/plan.h"
#include "firmware/motion/motion_limits.h"
#include "firmware/motion/rail_ends.h"
#include "firmware/motion/tick_motion.h"

namespace ballast::firmware {

namespace {

// The estimate is inside of its band by so many sigmas.
constexpr Real kSigmas = 3;
// A candidate goes to the end of the motion if that is at most so many times GovernorParams::step_s away.
constexpr Wide kMostStartSteps = 4000;
// The certificate in force is for another ball where the rates are off by this much of sqrt(g / r) from those that it
// predicts: the part of the friction that it keeps in reserve is used up by about that.
constexpr Real kTrustedRate = Real(0.01);
// The halt is rolled forward for so many times sqrt(r / g) at most. One of held masses begins when that is done.
constexpr Real kLongestHalt = 60, kLongestHeldHalt = 30;
// A start is certified for an attitude within this angle, too.
constexpr Real kSameAttitude_rad = Real(0.01);

// The friction that may be used: what the floor is believed to give, or gave while the ball slipped.
Real usable_friction(const ControllerParams& params, const ControllerState& state) {
  return std::fmin(params.governor.friction, params.governor.friction_use * state.slip_friction.least);
}

// The longest of the profiles in `active`.
Wide longest_s(const ControllerParams& params, const ControllerState& state) {
  Wide end_s = 0;
  for (int i = 0; i < params.ball.mass_count; ++i) end_s = std::fmax(end_s, state.active[at(i)].end_s());
  return end_s;
}

// The ball as it is known now, with the masses where they are held.
RobotState held_robot(const ControllerParams& params, const ControllerState& state, const BallMotion& motion) {
  RobotState robot;
  robot.orientation = motion.orientation;
  robot.angular_velocity_B_radps = motion.angular_velocity_B_radps;
  robot.position_W_m = state.estimate.position_W_m;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    robot.mass_position[at(i)] = static_cast<Real>(state.hold_position[at(i)]);
  }
  return robot;
}

// Ticks after the start at which the motion rests; 0: it does not.
std::int64_t ticks_to_rest(const ControllerParams& params, const ControllerState& state) {
  Wide end_s = 0;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    const Profile& profile = params.motion[at(i)];
    const Wide drift = state.started ? profile.at(0).velocity : 0;
    if (profile.final_velocity() != drift) return 0;
    end_s = std::fmax(end_s, profile.end_s());
  }
  if (!(end_s / Wide{state.governing.params.step_s} <= kMostStartSteps)) return 0;
  return static_cast<std::int64_t>(end_s / params.control_period_s) + 1;
}

// Begins the next attempt: to the motion's end first, then shorter and shorter. Time 0 is that of the start.
void begin_attempt(const ControllerParams& params, ControllerState& state) {
  GoverningState& g = state.governing;
  const std::int64_t lead = minus(g.start.from_tick, g.start.tick);
  const bool goes = g.start.what == Begins::kCourse;
  const std::int64_t rest_ticks = goes ? state.course.rest_ticks : ticks_to_rest(params, state);
  begin_start(g.params, g.start.robot, 0, lead, rest_ticks > 0 ? lead + rest_ticks : 0, g.start.attempt, g.governor);
}

// The robot as it is told to be set down.
RobotState first_robot(const ControllerParams& params) {
  RobotState robot;
  robot.orientation = params.estimation.initial_orientation;
  robot.angular_velocity_B_radps = params.estimation.initial_angular_velocity_B_radps;
  robot.position_W_m = params.estimation.initial_position_W_m;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    robot.mass_position[at(i)] = static_cast<Real>(params.motion[at(i)].at(0).position);
    robot.mass_velocity[at(i)] = static_cast<Real>(params.motion[at(i)].at(0).velocity);
  }
  return robot;
}

// The wish of the motion that a start would begin now.
Wish wish_of_start(const ControllerParams& params, const ControllerState& state, Wide time_s, bool feeds,
                   const RobotState& robot) {
  return wish_at(params, followed(params, state), state.tracking.integral_W_ms, time_s, feeds, robot);
}

void begin_search(const ControllerParams& params, const RobotState& robot, ControllerState& state) {
  state.governing.params.friction = usable_friction(params, state);
  state.governing.params.uncertain = 0;
  StartSearch& start = state.governing.start;
  set_origin(state);
  start.stage = StartStage::kSearching;
  start.what = Begins::kMotion;
  start.tick = start.from_tick = 0;
  start.robot = robot;
  // The first start begins with the motion's own jump.
  const bool feeds = params.tracking.samples > 0;
  state.governing.params.jumps = state.started || !feeds;
  if (!state.started && !feeds) {
    start.robot.mass_acceleration =
        governed_beginning(params.ball, state.governing.params, robot, wish_of_start(params, state, 0, false, robot).u)
            .u;
  }
  start.attempt = ticks_to_rest(params, state) > 0 ? kStartStretches : kStartStretches - 1;
  begin_attempt(params, state);
}

void advance_search(const ControllerParams& params, int work, ControllerState& state) {
  GoverningState& g = state.governing;
  if (g.start.stage != StartStage::kSearching) return;
  const bool feeds = params.tracking.samples > 0 && !state.started;
  Rollout& candidate = g.governor.candidate;
  const Wide held_s = static_cast<Wide>(minus(g.start.from_tick, g.start.tick)) * params.control_period_s;
  const auto law = [&](Wide time_s, const RobotState& then) {
    if (g.start.what == Begins::kMove) return wish_of_active(params, state, time_s - held_s, then);
    if (g.start.what == Begins::kHalt) {
      const PerMass<Real> u = halt_wish(params.ball, g.params, halt_gains(params.ball), then);
      return Wish{u, u};
    }
    if (g.start.what == Begins::kCourse) {
      return wish_at(params, coming_course(state), Vector2::Zero(), time_s - held_s, true, then);
    }
    return wish_of_start(params, state, time_s, feeds, then);
  };
  candidate.advance(params.ball, g.params, law, g.governor.bends, work);
  if (candidate.end() == RolloutEnd::kUnderWay) return;
  if (candidate.end() != RolloutEnd::kBroken) {
    g.start.stage = StartStage::kCertified;
    return;
  }
  // The refusal speaks of the shortest stretch, which is tried last.
  g.start.breach = candidate.breach();
  g.start.breach_s = candidate.time_s();
  // A course is certified for a short stretch first, a start for the whole motion.
  const bool goes = g.start.what == Begins::kCourse;
  const int last = goes ? kStartStretches - (state.course.rest_ticks > 0 ? 0 : 1) : 0;
  if ((!goes && g.start.what != Begins::kMotion) || g.start.attempt == last) {
    g.start.stage = StartStage::kRefused;
    return;
  }
  g.start.attempt += goes ? 1 : -1;
  begin_attempt(params, state);
}

bool same_ball(const ControllerParams& params, const RobotState& a, const BallMotion& b) {
  const Quaternion &p = a.orientation, &q = b.orientation;
  const Real cosine = std::fabs(p.w() * q.w() + p.x() * q.x() + p.y() * q.y() + p.z() * q.z());
  const Vector3 off = a.angular_velocity_B_radps - b.angular_velocity_B_radps;
  const Real rate = kTrustedRate / unit_s(params.ball);
  return cosine >= 1 - kSameAttitude_rad * kSameAttitude_rad / 8 && off.dot(off) <= rate * rate;
}

void put_masses(const PerMass<ProfilePoint>& from, int count, RobotState& robot) {
  for (int i = 0; i < count; ++i) {
    robot.mass_position[at(i)] = static_cast<Real>(from[at(i)].position);
    robot.mass_velocity[at(i)] = static_cast<Real>(from[at(i)].velocity);
    robot.mass_acceleration[at(i)] = static_cast<Real>(from[at(i)].acceleration);
  }
}

// The robot at the start of the tick `next`: the ball as it is known now, and the masses' commands of this tick.
RobotState next_robot(const ControllerParams& params, const ControllerState& state, const BallMotion& motion,
                      const Vector2& place_W_m, bool held, const PerMass<ProfilePoint>& from) {
  const int n = params.ball.mass_count;
  RobotState robot;
  robot.orientation = motion.orientation;
  robot.angular_velocity_B_radps = motion.angular_velocity_B_radps;
  robot.position_W_m = place_W_m;
  if (!held) {
    robot.mass_position = state.now.position;
    robot.mass_velocity = state.now.velocity;
    robot.mass_acceleration = state.now.acceleration;
    PerMass<Real> end{};
    for (int i = 0; i < n; ++i) end[at(i)] = static_cast<Real>(from[at(i)].acceleration);
    robot = after_ramp(params.ball, state.governing.params, robot, state.now.acceleration, end,
                       static_cast<Real>(params.control_period_s));
  }
  put_masses(from, n, robot);
  robot.swing_acceleration = state.governing.swing_acceleration;
  robot.swing_jerk = state.governing.swing_jerk;
  return robot;
}

// Lets the masses swing on through the commands of a tick.
void swing_on(const ControllerParams& params, const PerMass<ProfilePoint>& from, const PerMass<Wide>& end,
              GoverningState& g) {
  const auto h = static_cast<Real>(params.control_period_s);
  for (int i = 0; i < params.ball.mass_count; ++i) {
    if (!swings(g.params, at(i))) continue;
    const Real mean = static_cast<Real>((from[at(i)].acceleration + end[at(i)]) / 2);
    Real& acceleration = g.swing_acceleration[at(i)];
    Real& jerk = g.swing_jerk[at(i)];
    jerk += h * swing_rate(g.params.mass[at(i)].swing, mean, acceleration, jerk);
    acceleration += h * jerk;
  }
}

// Lets the next certificate replace the one in force where the ball leaves the path that it was made for. The sum of
// the differences of one tick is the whole one, but for what it does to the dynamics.
void watch_path(const ControllerParams& params, const RobotState& robot, GoverningState& g) {
  if (g.certificate_tick != g.governor.certificate.switch_tick) {
    g.certificate_tick = g.governor.certificate.switch_tick;
    g.off_path_B_radps = Vector3::Zero();
  } else if (g.expects) {
    g.off_path_B_radps += robot.angular_velocity_B_radps - g.expected_B_radps;
  }
  const Real rate = kTrustedRate / unit_s(params.ball);
  if (g.off_path_B_radps.dot(g.off_path_B_radps) <= rate * rate) return;
  distrust(g.governor);
  g.off_path_B_radps = Vector3::Zero();
}

// Omega without what masses add that swing fast about their commands, which takes the ball along and goes past its mean
// by as much again. It follows what is sensed within some swings, and what is predicted at once.
void calm_down(const ControllerParams& params, const RobotState& robot, GoverningState& g) {
  constexpr Real kSwings = 5;           // radians of the slowest swing
  constexpr Real kFarOff = Real(0.05);  // of sqrt(g / r): more is no swing, but a push
  Real slowest_radps = std::numeric_limits<Real>::infinity();
  for (int i = 0; i < params.ball.mass_count; ++i) {
    const Real natural_radps = g.params.mass[at(i)].swing.natural_radps;
    if (natural_radps > 0 && !swings(g.params, at(i))) slowest_radps = std::fmin(slowest_radps, natural_radps);
  }
  const Real part = static_cast<Real>(params.control_period_s) * slowest_radps / kSwings;
  const Vector3& sensed = robot.angular_velocity_B_radps;
  const Vector3 predicted = g.calm_B_radps + g.expected_B_radps - g.sensed_B_radps;
  const Vector3 off = sensed - predicted;
  const Real far_radps = kFarOff / unit_s(params.ball);
  const bool follows = g.expects && part < 1 && off.dot(off) < far_radps * far_radps;
  g.calm_B_radps = follows ? Vector3(predicted + part * off) : sensed;
  g.sensed_B_radps = sensed;
}

// Whether the tick's work is that of a halt's prediction: every eighth is, so that the search for its certificate is
// hardly later; it also has those without a search.
bool predicts_halt(const GoverningState& g, std::int64_t tick) {
  constexpr std::int64_t kEvery = 8, kTurn = 2;
  const bool alone = g.governor.candidate.end() != RolloutEnd::kUnderWay;
  return g.halt.predicts && !g.halt.rollout.result().complete && (alone || tick % kEvery == kTurn);
}

// Begins to predict the halt of the candidate that has begun in this tick, or rolls it forward.
template <class Law>
void predict_halt(const ControllerParams& params, const RobotState& robot, std::int64_t tick, const Law& law, int work,
                  GoverningState& g) {
  HaltState& halt = g.halt;
  const Rollout& candidate = g.governor.candidate;
  if (g.governor.changing && candidate.start_tick() == tick) {
    halt.predicts = true;
    halt.predicted_tick = candidate.schedule().from;
    halt.rollout_tick = tick;
    halt.rollout.begin(g.params, robot, tick, candidate.schedule(), Wide{kLongestHalt * unit_s(params.ball)});
  }
  if (work > 0) halt.rollout.advance(params.ball, g.params, law, g.governor.bends, work);
}

// Errors of the estimate, as the next tick's cone takes them.
void weigh_errors(const ControllerParams& params, const ControllerState& state, const RobotState& robot,
                  const PerMass<Real>& u, GoverningState& g) {
  if (!params.estimation.estimated || std::isinf(g.params.friction)) return;
  StateErrors errors;
  errors.tilt_rad = kSigmas * state.estimate.tilt_sigma_rad;
  errors.omega_radps = kSigmas * (params.estimation.gyro.noise + state.estimate.gyro_bias_sigma_radps);
  g.sensitivity.advance(params.ball, g.params.friction, robot, u, errors);
  g.params.uncertain = g.sensitivity.share();
}

}  // namespace

GovernorParams governor_params(const ControllerParams& params) {
  GovernorParams out;
  out.friction = params.governor.friction;
  out.min_normal_force_n = params.governor.min_normal_force_n;
  out.belief_error = params.governor.belief_error;
  for (int i = 0; i < params.ball.mass_count; ++i) {
    MassLimits& mass = out.mass[at(i)];
    const RailEnds ends = rail_ends(params.ball, i);
    const MotorParams& motor = params.motor[at(i)];
    mass.max_velocity = static_cast<Real>(motion_limits(params, i).max_velocity);
    mass.max_acceleration = static_cast<Real>(motor.max_acceleration);
    mass.max_jerk = mass.motor_jerk = static_cast<Real>(motor.max_jerk);
    mass.lower_end = static_cast<Real>(ends.lower + motor.swing);
    mass.upper_end = static_cast<Real>(ends.upper - motor.swing);
    mass.swing = params.governor.swing[at(i)];
  }
  set_times(params.ball, params.control_period_s, out);
  return out;
}

void reset_governing(const ControllerParams& params, ControllerState& state) {
  GoverningState& g = state.governing;
  g.report = {};
  g.governs = false;
  g.halt.asked = g.halt.begun = g.halt.predicts = false;
  g.halt.slow_ticks = 0;
  g.start.stage = StartStage::kNone;
  if (!params.governor.on) return;
  g.params = governor_params(params);
  // The first start is certified at once.
  begin_search(params, first_robot(params), state);
  // Every call does a step, and an attempt has at most these; the last 1000 are for its stretch and its brake.
  const Wide most = Wide{kEdgeSteps} * (kMostStartSteps + 1000) + g.params.horizon_s / Wide{g.params.step_s};
  for (Wide steps = 0; steps < most * (kStartStretches + 1) && g.start.stage == StartStage::kSearching; ++steps) {
    advance_search(params, 1, state);
  }
}

void watch_start(const ControllerParams& params, const Inputs& inputs, ControllerState& state) {
  if (!params.governor.on || state.mode != Mode::kArmed) return;
  if (state.governing.start.what != Begins::kMotion) {
    state.governing.start.what = Begins::kMotion;
    state.governing.start.stage = StartStage::kNone;
  }
  if (!state.started) {
    // A move or a halt has used the search.
    if (state.governing.start.stage == StartStage::kNone) begin_search(params, first_robot(params), state);
    return;
  }
  const BallMotion motion = ball_motion(params, state, inputs.sensors);
  StartSearch& start = state.governing.start;
  if (!motion.known) {
    start.stage = StartStage::kNone;
    return;
  }
  if (start.stage != StartStage::kNone && start.stage != StartStage::kUsed && same_ball(params, start.robot, motion)) {
    return;
  }
  begin_search(params, held_robot(params, state, motion), state);
}

// A move is not bent: it is certified as a whole, or refused.
void begin_move_search(const ControllerParams& params, const Inputs& inputs, ControllerState& state) {
  GoverningState& g = state.governing;
  StartSearch& start = g.start;
  start.stage = StartStage::kNone;
  if (!params.governor.on) return;
  g.params.friction = usable_friction(params, state);
  g.params.uncertain = 0;
  g.params.jumps = false;
  start.what = Begins::kMove;
  start.tick = inputs.tick;
  start.from_tick = state.plan_tick;
  const BallMotion motion = ball_motion(params, state, inputs.sensors);
  if (!motion.known) return;
  start.stage = StartStage::kSearching;
  start.robot = held_robot(params, state, motion);
  // Times of the search count from today.
  const std::int64_t lead = minus(start.from_tick, start.tick);
  const auto motion_ticks = static_cast<std::int64_t>(longest_s(params, state) / params.control_period_s) + 1;
  begin_start(g.params, start.robot, 0, lead, lead + motion_ticks, kStartStretches, g.governor);
  g.governor.candidate.refuse_bends(std::numeric_limits<Wide>::infinity());
}

// Begins the next attempt from the ball of today: with longer and longer stretches of the halt.
void try_halt(const ControllerParams& params, const Inputs& inputs, ControllerState& state) {
  GoverningState& g = state.governing;
  StartSearch& start = g.start;
  start.stage = StartStage::kNone;
  const BallMotion motion = ball_motion(params, state, inputs.sensors);
  if (!motion.known) return;
  start.stage = StartStage::kSearching;
  start.robot = held_robot(params, state, motion);
  start.tick = inputs.tick;
  start.from_tick = plus(inputs.tick, ticks_to_certify(g.params, Wide{kLongestHeldHalt * unit_s(params.ball)}));
  const std::int64_t lead = minus(start.from_tick, start.tick);
  begin_start(g.params, start.robot, 0, lead, 0, 2 * start.attempt, g.governor);
  g.governor.candidate.refuse_bends(static_cast<Wide>(lead) * params.control_period_s);  // the masses hold until then
  g.halt.predicts = true;
  g.halt.predicted_tick = start.from_tick;
  g.halt.rollout_tick = start.tick;
  g.halt.rollout.begin(g.params, start.robot, 0, g.governor.candidate.schedule(),
                       Wide{kLongestHeldHalt * unit_s(params.ball)});
}

Wide longest_governed_move_s(const ControllerParams& params, const ControllerState& state) {
  if (!params.governor.on) return std::numeric_limits<Wide>::infinity();
  constexpr Wide kMostTicks = 1e9;  // that can be counted
  return std::fmin(kMostStartSteps * Wide{state.governing.params.step_s}, kMostTicks * params.control_period_s);
}

int ticks_of_move_search(const ControllerParams& params, const ControllerState& state) {
  return params.governor.on ? ticks_to_certify(state.governing.params, longest_s(params, state)) : 0;
}

void search_start(const ControllerParams& params, ControllerState& state) {
  if (!params.governor.on || state.moving) return;
  GoverningState& g = state.governing;
  const bool predicts = g.start.what == Begins::kHalt && g.halt.predicts && !g.halt.rollout.result().complete;
  // Held masses leave a tick more time than governed ones. A halt's prediction shares it.
  const int work = predicts ? g.params.work_per_tick : 4 * g.params.work_per_tick / 3;
  advance_search(params, work, state);
  if (!predicts) return;
  const auto law = [&](Wide, const RobotState& then) {
    const PerMass<Real> u = halt_wish(params.ball, g.params, halt_gains(params.ball), then);
    return Wish{u, u};
  };
  g.halt.rollout.advance(params.ball, g.params, law, g.governor.bends, work);
}

RefusalReport judge_start(const ControllerParams& params, const ControllerState& state) {
  if (!params.governor.on) return {};
  const StartSearch& start = state.governing.start;
  switch (start.stage) {
    case StartStage::kCertified:
      return {};
    case StartStage::kRefused:
      if (start.breach.normal_force_n < params.governor.min_normal_force_n) {
        return {Refusal::kLiftsOff, -1, -1, Wide{start.breach.normal_force_n}, start.breach_s};
      }
      return {Refusal::kNoBackup, -1, -1, Wide{start.breach.use}, start.breach_s};
    case StartStage::kNone:
    case StartStage::kSearching:
    case StartStage::kUsed:
      break;
  }
  return {Refusal::kNotCertified, -1, -1, 0, 0};
}

namespace {

// Puts the certificate that was found into force.
void adopt(std::int64_t next, GoverningState& g) {
  adopt_start(g.params, next, g.governor);
  g.governs = true;
  g.expects = false;
  g.swing_acceleration = {};
  g.swing_jerk = {};
  g.certificate_tick = g.governor.certificate.switch_tick;
  g.off_path_B_radps = Vector3::Zero();
  g.sensitivity.reset();
  g.params.uncertain = 0;
  g.start.stage = StartStage::kUsed;
}

}  // namespace

void begin_governing(const ControllerParams& params, const Inputs& inputs, ControllerState& state, std::int64_t next) {
  GoverningState& g = state.governing;
  const Wide end_ticks = static_cast<Wide>(ticks_to_rest(params, state));
  adopt(next, g);
  if (end_ticks > 0) g.governor.nominal_end_tick = next + static_cast<std::int64_t>(end_ticks);
  g.halt.asked = g.halt.begun = g.halt.predicts = false;
  const BallMotion motion = ball_motion(params, state, inputs.sensors);
  if (!motion.known || !same_ball(params, g.start.robot, motion)) distrust(g.governor);
}

Wide governed_jerk(const GoverningState& governing, int i, Wide jump, Wide period_s) {
  const Wide bent = Wide{governing.params.mass[at(i)].max_jerk};
  return governing.governor.mode == GovernorMode::kNominal ? bent + std::fabs(jump) / period_s : bent;
}

void begin_halt(ControllerState& state) {
  GoverningState& g = state.governing;
  g.halt.asked = true;
  g.params.jumps = false;
  g.halt.begun = g.halt.predicts = false;
  g.halt.slow_ticks = 0;
  change_nominal(g.governor);
}

void ask_for_halt(const ControllerParams& params, const Inputs& inputs, ControllerState& state) {
  GoverningState& g = state.governing;
  g.params.friction = usable_friction(params, state);
  g.params.uncertain = 0;
  g.params.jumps = false;
  g.halt.asked = true;
  g.halt.begun = g.halt.predicts = false;
  g.halt.slow_ticks = 0;
  g.halt.without_rest_mps = 0;
  g.start.what = Begins::kHalt;
  g.start.attempt = 0;
  try_halt(params, inputs, state);
}

RefusalReport await_halt(const ControllerParams& params, const Inputs& inputs, ControllerState& state,
                         std::int64_t next) {
  GoverningState& g = state.governing;
  StartSearch& start = g.start;
  const bool due = next == start.from_tick;
  if (!due && start.stage != StartStage::kRefused) return {};
  const HaltPrediction& said = g.halt.rollout.result();
  // On a slope no held ball is safe for ever, so a halt begins only where it is known to bring the ball to rest.
  const bool slopes = params.ball.down_W.x() != 0 || params.ball.down_W.y() != 0;
  const bool slower = said.speed_after_mps < said.speed_before_mps && !slopes;
  const bool certified = start.stage == StartStage::kCertified;
  if (certified && (said.complete ? said.rests || slower : !slopes)) {
    adopt(next, g);
    distrust(g.governor);  // the ball may have been pushed since the search began
    for (int i = 0; i < params.ball.mass_count; ++i) {
      if (!state.active[at(i)].set(state.hold_position[at(i)], 0, nullptr, 0)) state.faults |= bit(Fault::kInternal);
    }
    begin(state, next);
    begin_tracking(state, next, false);
    g.governs = true;
    g.halt.begun = true;
    g.halt.from_tick = next;
    g.halt.wish = {};
    return {};
  }
  // A longer stretch of the halt may be certified where a shorter one is not, and a ball that rocks may be halted
  // later.
  RefusalReport refusal = judge_start(params, state);
  if (certified) refusal.reason = Refusal::kNotCertified;
  if (certified && said.complete) g.halt.without_rest_mps = said.speed_after_mps;
  if (refusal.reason == Refusal::kNotCertified && g.halt.without_rest_mps > 0) {
    refusal = {Refusal::kNoRest, -1, -1, Wide{g.halt.without_rest_mps}, Wide{kLongestHeldHalt * unit_s(params.ball)}};
  }
  ++start.attempt;
  if (start.attempt == kStretches) return refusal;
  try_halt(params, inputs, state);
  return {};
}

bool search_course(const ControllerParams& params, const Inputs& inputs, ControllerState& state) {
  const BallMotion motion = ball_motion(params, state, inputs.sensors);
  if (!motion.known) return false;
  if (!state.planned) drop_plan(state);
  GoverningState& g = state.governing;
  g.params.friction = usable_friction(params, state);
  g.params.uncertain = 0;
  g.params.jumps = false;
  const CourseState& course = state.course;
  StartSearch& start = g.start;
  start.stage = StartStage::kSearching;
  start.what = Begins::kCourse;
  start.tick = inputs.tick;
  start.from_tick = course.from_tick == 0 ? inputs.tick : course.from_tick;
  start.robot = held_robot(params, state, motion);
  if (!params.estimation.estimated) {
    const ReferenceTable& reference = course.coming().reference;
    start.robot.position_W_m = reference_at(reference, params.ball.mass_count, params.ball.radius_m, 0).position_W_m;
  }
  // A short stretch first, since someone waits. The shortest of all would end before the next search does.
  start.attempt = 1;
  begin_attempt(params, state);
  return true;
}

CourseVerdict judge_course(const ControllerParams& params, const Inputs& inputs, const ControllerState& state) {
  const StartSearch& start = state.governing.start;
  if (start.stage == StartStage::kRefused) return {true, judge_start(params, state)};
  const std::int64_t next = plus(inputs.tick, 1);
  if (state.course.from_tick != 0) {
    if (next < state.course.from_tick) return {};
    if (next == state.course.from_tick && start.stage == StartStage::kCertified) return {true, {}};
    return {true, {Refusal::kLate, -1, -1, static_cast<Wide>(state.course.from_tick), 0}};
  }
  if (start.stage != StartStage::kCertified) return {};
  const BallMotion motion = ball_motion(params, state, inputs.sensors);
  const bool rests = motion.known && same_ball(params, start.robot, motion);
  return {true, rests ? RefusalReport{} : RefusalReport{Refusal::kNotCertified, -1, -1, 0, 0}};
}

void set_out(const ControllerParams& params, ControllerState& state, std::int64_t next) {
  GoverningState& g = state.governing;
  adopt(next, g);
  g.halt.asked = g.halt.begun = g.halt.predicts = false;
  if (state.course.from_tick != 0) distrust(g.governor);  // the ball may have been pushed since the search began
  for (int i = 0; i < params.ball.mass_count; ++i) {
    if (!state.active[at(i)].set(state.hold_position[at(i)], 0, nullptr, 0)) state.faults |= bit(Fault::kInternal);
  }
  begin(state, next);
  begin_tracking(state, next, true);
  state.governing.governs = true;
  put_in_force(state, next);
}

void await_course(const ControllerParams& params, ControllerState& state) {
  GovernorState& governor = state.governing.governor;
  const Rollout& candidate = governor.candidate;
  const std::int64_t from_tick = state.course.from_tick;
  // Where the certificate in force goes beyond the course's first tick, it is one of the old motion there.
  if (governor.certificate.switch_tick > from_tick) {
    change_nominal_at(from_tick, governor);
    return;
  }
  // So is a search that has come there already. One that has not goes on with the course.
  const auto come = static_cast<std::int64_t>(candidate.time_s() / params.control_period_s);
  if (governor.searching && candidate.start_tick() + come >= from_tick) keep_nominal(governor);
}

std::int64_t ticks_of_course_search(const GoverningState& governing, std::int64_t left) {
  const GovernorParams& params = governing.params;
  return likely_search_ticks(params, governing.governor, left + params.stretch_ticks + params.search_ticks);
}

RefusalReport watch_course(const ControllerState& state, std::int64_t next) {
  const GoverningState& g = state.governing;
  const GovernorState& governor = g.governor;
  const std::int64_t from = state.course.from_tick;
  const RolloutEnd end = governor.candidate.end();
  const bool broken = governor.searching && end == RolloutEnd::kBroken;
  const RefusalReport breach{Refusal::kNoBackup, -1, -1, Wide{governor.candidate.breach().use},
                             governor.candidate.time_s()};
  if (!g.governs || governor.mode != GovernorMode::kNominal) return {Refusal::kNotCertified, -1, -1, 0, 0};
  const bool ready = governor.searching && end != RolloutEnd::kUnderWay && !broken;
  if (governor.changing) {
    if (next < from) return {};
    if (ready && governor.candidate.schedule().from == next) return {};
    return broken ? breach : RefusalReport{Refusal::kLate, -1, -1, static_cast<Wide>(from), 0};
  }
  if (governor.certificate.switch_tick > from) return {};
  if (next >= from) return {Refusal::kLate, -1, -1, static_cast<Wide>(from), 0};
  // A certificate is still possible while the old motion can go on without one.
  const bool runs_out = governor.certificate.switch_tick - next < 2 * std::int64_t{g.params.search_ticks};
  if (broken && runs_out && governor.candidate.schedule().to > from) return breach;
  return {};
}

void forget_course(GoverningState& governing) {
  GovernorState& governor = governing.governor;
  if (governor.changing && governor.change_tick == 0) return;  // it becomes a halt
  keep_nominal(governor);
}

bool halted(const ControllerParams& params, const ControllerState& state) {
  return static_cast<Wide>(state.governing.halt.slow_ticks) * params.control_period_s >= kRestTime_s;
}

bool halts(const GoverningState& governing, std::int64_t tick) {
  if (governing.halt.begun) return true;
  const GovernorState& governor = governing.governor;
  const RolloutEnd end = governor.candidate.end();
  return governing.halt.asked && governor.changing && governor.searching && end != RolloutEnd::kUnderWay &&
         end != RolloutEnd::kBroken && governor.candidate.schedule().from == tick;
}

HaltWish wish_of_halt(const ControllerParams& params, const ControllerState& state, const TickToGovern& now) {
  const RobotState robot = next_robot(params, state, now.motion, now.place_W_m, now.held, now.from);
  HaltWish out;
  out.wish = halt_wish(params.ball, state.governing.params, halt_gains(params.ball), robot);
  const HaltState& halt = state.governing.halt;
  for (int i = 0; i < params.ball.mass_count && halt.begun; ++i) out.change[at(i)] = out.wish[at(i)] - halt.wish[at(i)];
  return out;
}

void bend_beginning(const ControllerParams& params, const ControllerState& state, TickToGovern& now) {
  const GovernorParams& governor = state.governing.params;
  const RobotState robot = next_robot(params, state, now.motion, now.place_W_m, now.held, now.from);
  PerMass<Real> wish{};
  for (int i = 0; i < params.ball.mass_count; ++i) wish[at(i)] = static_cast<Real>(now.from[at(i)].acceleration);
  const Projection bent = governed_beginning(params.ball, governor, robot, wish);
  for (int i = 0; i < params.ball.mass_count && bent.bent; ++i) {
    now.from[at(i)].acceleration = Wide{bent.u[at(i)]};
  }
}

void govern_tick(const ControllerParams& params, const TickToGovern& now, ControllerState& state,
                 PerMass<Wide>& accelerations) {
  GoverningState& g = state.governing;
  const int n = params.ball.mass_count;
  const RobotState robot = next_robot(params, state, now.motion, now.place_W_m, now.held, now.from);
  watch_path(params, robot, g);
  calm_down(params, robot, g);
  RobotState calm = robot;
  calm.angular_velocity_B_radps = g.calm_B_radps;
  Ramp ramp;
  ramp.h_s = static_cast<Real>(params.control_period_s);
  NominalEnd nominal;
  for (int i = 0; i < n; ++i) {
    ramp.start[at(i)] = static_cast<Real>(now.from[at(i)].acceleration);
    ramp.end.lower[at(i)] = static_cast<Real>(now.lowest[at(i)]);
    ramp.end.upper[at(i)] = static_cast<Real>(now.highest[at(i)]);
    nominal.wish[at(i)] = static_cast<Real>(now.wanted[at(i)]);
    nominal.reached[at(i)] = static_cast<Real>(accelerations[at(i)]);
  }
  const HaltGains gains = halt_gains(params.ball);
  const Wide period_s = params.control_period_s;
  // The wish at a time after the start of `from`. The halt is the wish from the start of `halt_tick` on.
  const auto wish_after = [&](std::int64_t from, bool to_halt, std::int64_t halt_tick, Wide time_s,
                              const RobotState& then) {
    if (to_halt && time_s >= (static_cast<Wide>(minus(halt_tick, from)) - Wide(0.5)) * period_s) {
      const PerMass<Real> u = halt_wish(params.ball, g.params, gains, then);
      return Wish{u, u};
    }
    const Vector2& integral_W_ms = state.tracking.integral_W_ms;
    if (state.course.stage == CourseStage::kAwaited) {
      const Wide course_s = time_s - static_cast<Wide>(minus(state.course.from_tick, from)) * period_s;
      if (course_s >= -period_s / 2) return wish_at(params, coming_course(state), integral_W_ms, course_s, true, then);
    }
    const Wide begun_s = static_cast<Wide>(minus(from, state.tracking.start_tick)) * period_s;
    return wish_at(params, followed(params, state), integral_W_ms, begun_s + time_s, state.tracking.feeds, then);
  };
  const auto law = [&](Wide time_s, const RobotState& then) {
    const Rollout& candidate = g.governor.candidate;
    const std::int64_t halt_tick = g.halt.begun ? g.halt.from_tick : candidate.schedule().from;
    return wish_after(candidate.start_tick(), g.halt.asked, halt_tick, time_s, then);
  };
  GovernorOutput out;
  // A window of the estimate that ends costs as much as a step of the search, and so do the wishes of a halt.
  const int estimating = state.filter.window.samples == 1 ? kMovingStepWork : 0;
  const int others = estimating + (g.halt.asked ? kMovingStepWork : 0);
  const bool predicting = g.halt.asked && predicts_halt(g, now.tick);
  const int spent = predicting ? g.params.work_per_tick : others;
  govern(params.ball, g.params, robot, calm, ramp, nominal, law, now.tick, spent, g.governor, out);
  if (g.halt.asked) {
    if (!g.halt.begun && !g.governor.changing) {
      g.halt.begun = true;
      g.halt.from_tick = now.tick;
    }
    const auto law_of_halt = [&](Wide time_s, const RobotState& then) {
      return wish_after(g.halt.rollout_tick, true, g.halt.predicted_tick, time_s, then);
    };
    const int work = predicting ? left_work(g.params, out.cost) - others : 0;
    predict_halt(params, robot, now.tick, law_of_halt, work, g);
    // On the backup the ball may come to rest before a halt has been certified.
    const bool halts = g.halt.begun || g.governor.mode == GovernorMode::kBackup;
    g.halt.slow_ticks =
        halts && speed_mps(params.ball, robot) < rest_speed_mps(params.ball) ? g.halt.slow_ticks + 1 : 0;
  }
  g.report = out.report;
  g.expects = true;
  g.expected_B_radps = out.end.angular_velocity_B_radps;
  weigh_errors(params, state, robot, out.acceleration, g);
  for (int i = 0; i < n && out.report.bent; ++i) {
    const Wide u{out.acceleration[at(i)]};
    accelerations[at(i)] = std::fmin(std::fmax(u, now.lowest[at(i)]), now.highest[at(i)]);
  }
  swing_on(params, now.from, accelerations, g);
}

}  // namespace ballast::firmware
