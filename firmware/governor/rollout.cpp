#include "firmware/governor/rollout.h"

#include <cmath>

#include "firmware/governor/motor_allowance.h"

namespace ballast::firmware {

namespace {

// Steps of a moving ball are shorter than those of a held one, and near the cone's edge still shorter: states in which
// no acceleration keeps the cone may last for less than a step.
constexpr Real kMovingSteps = 2;
constexpr Real kNearEdge = Real(0.97);
// Bends are kept up to this part of max_acceleration. On a floor that needs all of the friction it is less than what
// the reserves leave.
constexpr Real kBendTolerance = Real(5e-4);
// Where limits of the masses do not leave all of the reserve, this part of it has to be left. The plan in force was
// certified with the greater part, and what has changed since is small.
constexpr Real kKept = Real(0.7), kKeptAlongPlan = Real(0.25);
// Part of max_velocity that bends keep free.
constexpr Real kSpareSpeed = Real(0.02);

// A motion's jump takes the wish along by a little more: ahead() leaves it out.
constexpr Real kUnbentJump = Real(1.1);

}  // namespace

void Rollout::begin(const GovernorParams& params, const RobotState& state, std::int64_t tick,
                    const Schedule& schedule) {
  end_ = RolloutEnd::kUnderWay;
  state_ = state;
  schedule_ = schedule;
  start_tick_ = tick_ = tick;
  period_s_ = params.control_period_s;
  time_s_ = change_s_ = 0;
  held_ = near_edge_ = tells_way_ = wished_ = begun_ = last_ = false;
  bends_from_s_ = 0;
  astray_ = {};
  renewed_ = false;
  PerMass<Real> tolerance{};
  for (std::size_t i = 0; i < tolerance.size(); ++i) tolerance[i] = kBendTolerance * params.mass[i].max_acceleration;
  bends_.clear(tick, tolerance);
  most_use_ = 0;
}

// Follows the schedule, and returns how far the next step may go.
Real Rollout::next_step_s(const GovernorParams& params) {
  while (!last_ && time_s_ >= change_s_) {
    tick_ = start_tick_ + static_cast<std::int64_t>(change_s_ / period_s_ + Wide(0.5));
    nominal_now_ = schedule_.nominal(tick_);
    wished_ = false;  // the wish may become another one
    last_ = tick_ >= schedule_.backup_from();
    if (last_) break;
    change_s_ = static_cast<Wide>(schedule_.next_change(tick_) - start_tick_) * period_s_;
  }
  const Wide end_s =
      last_ ? static_cast<Wide>(schedule_.backup_from() - start_tick_) * period_s_ + params.horizon_s : change_s_;
  const Wide left_s = end_s - time_s_;
  const Real parts = near_edge_ && !tells_way_ ? kEdgeSteps : kMovingSteps;
  const Real step_s = held_ ? params.step_s : params.step_s / parts;
  if (last_ && !(left_s > 0)) {
    end_ = RolloutEnd::kHorizon;
    return 0;
  }
  return left_s < Wide{step_s} ? static_cast<Real>(left_s) : step_s;
}

// `use`: with what a ball that is not as believed may add.
void Rollout::use(const GovernorParams& params, Real use, Real normal_force_n) {
  const Real kept = held_ ? params.reserve : params.moving_reserve * (guided(time_s_) ? kKeptAlongPlan : kKept);
  const Real allowed = 1 - kept;
  if (last_ && !(use <= most_use_)) most_use_ = use;
  if (use <= allowed || tells_way_) return;
  end_ = RolloutEnd::kBroken;
  breach_ = {use / allowed, normal_force_n};
}

RobotState Rollout::ahead(const BallParams& ball, const GovernorParams& params, Real h_s) const {
  RobotState to = state_;
  TurningRate change;
  const Vector3 omega_dot = forces_.omega_dot(ball.mass_count, state_.mass_acceleration);
  change.add(turning_rate(state_.orientation, state_.angular_velocity_B_radps, omega_dot, ball.radius_m), h_s);
  apply(change, to);
  if (nominal_now_) {
    move_masses(ball.mass_count, h_s, to);
  } else {
    // Bends last: a mass that is bent as much as it brakes keeps its speed.
    brake_masses(params, ball.mass_count, h_s, guided(time_s_ + Wide{h_s}) ? planned_ : bent_, to);
  }
  return to;
}

void Rollout::keep(const PerMass<Real>& bend) {
  if (tells_way_ || bends_.add(time_s_, bend) || end_ != RolloutEnd::kUnderWay) return;
  end_ = RolloutEnd::kBroken;
  breach_.use = 0;
}

void Rollout::bend(const BallParams& ball, const PerMass<Real>& wish) {
  PerMass<Real> off{};
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    off[i] = state_.mass_acceleration[i] - wish[i];
  }
  bent_ = off;
  keep(off);
}

// The mass is not bent at the start of the step.
bool Rollout::follows_wish(const GovernorParams& params, std::size_t i) const {
  return std::fabs(state_.mass_acceleration[i] - last_wish_.u[i]) <= Real(1e-9) * params.mass[i].max_acceleration;
}

// The wish has become another one, or a rollout begins.
void Rollout::begin_wish(const BallParams& ball, const GovernorParams& params, const Wish& wish) {
  if (!begun_) forces_ = forces_at(ball, params, state_);
  begun_ = wished_ = true;
  last_wish_ = wish;
  bend(ball, wish.u);
  // The change of the wish is no bend that lasts.
  bent_ = {};
}

bool Rollout::guided(Wide time_s) const {
  return !(schedule_.from < schedule_.to) ||
         time_s < (static_cast<Wide>(schedule_.from - start_tick_) + Wide(0.25)) * period_s_;
}

PerMass<Real> Rollout::guide(const Bends& in_force, Wide time_s) const {
  if (!guided(time_s)) return {};
  return in_force.at(time_s + static_cast<Wide>(start_tick_ - in_force.start_tick()) * period_s_, period_s_);
}

void Rollout::finish_step(const BallParams& ball, const GovernorParams& params, const Wish& wish, Real h_s) {
  if (end_ != RolloutEnd::kUnderWay) return;
  const Wide end_s = time_s_ + Wide{h_s};
  const bool follows_plan = guided(end_s);
  Ramp ramp;
  ramp.start = state_.mass_acceleration;
  ramp.h_s = h_s;
  ramp.swing = ramp.quick = true;
  if (params.belief_error.any()) {
    renewed_ = !renewed_;
    if (renewed_) drift_at(ball, params, state_, forces_, true, drift_);
    astray_.advance(drift_, h_s);
    ramp.belief_n = astray_.force_n(drift_);
  }
  ramp.spare = follows_plan ? params.moving_reserve / 2 : params.moving_reserve;
  // Bends change as fast as max_jerk allows, and the nominal's own changes are followed.
  PerMass<Real> change{}, wanted = wish.u;
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    const bool follows = nominal_now_ && (params.jumps || swings(params, i));
    const Real own = follows ? std::fabs(wish.own[i] - last_wish_.own[i]) : 0;
    // The motor follows no more than its jerk, or the motion's own jump where that is more (track()).
    const Real jump = params.jumps ? own : 0;
    Real most = std::fmax(params.mass[i].motor_jerk * h_s, jump);
    if (follows_wish(params, i) && planned_[i] == 0) most = std::fmax(most, kUnbentJump * jump);
    change[i] = std::fmin(params.mass[i].max_jerk * h_s + own, most);
    wanted[i] += planned_[i];
  }
  // A bend leaves some speed free, so that the robot can repeat it.
  const Box all = box_of(params, state_, ball.mass_count, h_s, 0);
  Box box = box_of(params, state_, ball.mass_count, h_s, kSpareSpeed);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    // A mass that is faster is slowed down no faster than the robot can.
    box.upper[i] = std::fmax(box.upper[i], std::fmin(ramp.start[i] - change[i], all.upper[i]));
    box.lower[i] = std::fmin(box.lower[i], std::fmax(ramp.start[i] + change[i], all.lower[i]));
    if (!follows_plan && !follows_wish(params, i)) continue;
    box.upper[i] = std::fmax(box.upper[i], std::fmin(wanted[i], all.upper[i]));
    box.lower[i] = std::fmin(box.lower[i], std::fmax(wanted[i], all.lower[i]));
  }
  ramp.end = near(box, ramp.start, change);
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    wanted[i] = std::fmin(std::fmax(wanted[i], ramp.end.lower[i]), ramp.end.upper[i]);
  }
  const bool bends = time_s_ >= bends_from_s_;
  if (!bends && nominal_now_) {
    wanted = wish.u;
    ramp.end = {wanted, wanted};
  }
  GovernedRamp end;
  governed_for_ramp(ball, params, state_, forces_, ramp, wanted, end);
  cost_ = cost_of(end);
  state_ = end.state;
  forces_ = end.forces;
  time_s_ = end_s;
  last_wish_ = wish;
  judge(params, end);
  bend(ball, wish.u);
  if (end_ == RolloutEnd::kUnderWay && last_ && still(params, state_, ball.mass_count)) begin_hold(ball, params);
}

void Rollout::judge(const GovernorParams& params, const GovernedRamp& end) {
  const Vector3& f = end.force_W_n;
  const Real used =
      std::isinf(params.friction) ? 0 : use_of(params.friction, std::sqrt(f[0] * f[0] + f[1] * f[1]), f[2]);
  near_edge_ = used > kNearEdge || end.command.bent;
  breach_ = {used, f[2]};
  if (!std::isinf(params.friction)) use(params, used + use_of(params.friction, end.belief_n, f[2]), f[2]);
  if (end.outside_n <= 0 || tells_way_) return;
  end_ = RolloutEnd::kBroken;
  // The cone keeps some friction free for motors and errors.
  if (f[2] > 0 && !std::isinf(params.friction)) breach_.use = 1 + end.outside_n / (params.friction * f[2]);
}

// The masses creep on for the linear end of the brake. However slow that is, each microstep is a jump of their fields.
Real Rollout::settling_use(const BallParams& ball, const GovernorParams& params) const {
  if (std::isinf(params.friction)) return 0;
  Cone cone = cone_of(params, forces_, state_, ball.mass_count);
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    cone.error[i] = acceleration_error(params.mass[i].swing, state_.mass_velocity[i], true);
  }
  const Real normal_n = forces_.force(ball.mass_count, state_.mass_acceleration)[2];
  if (!(normal_n > 0)) return 0;
  return errors_n(cone, forces_, ball.mass_count, state_.mass_acceleration) / (params.friction * normal_n);
}

void Rollout::begin_hold(const BallParams& ball, const GovernorParams& params) {
  settling_use_ = settling_use(ball, params);
  settled_s_ = time_s_ + Wide{params.brake_time_s};
  // The linear end of the brake takes brake_time_s and moves a mass by half of that times its velocity.
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    state_.mass_position[i] += state_.mass_velocity[i] * params.brake_time_s / 2;
    state_.mass_velocity[i] = 0;
  }
  held_ = true;
  keep({});
  if (end_ != RolloutEnd::kUnderWay) return;
  held_ball_ = hold_masses(ball, state_.mass_position);
  use_before_ = use_at_ = 0;
  HeldErrors errors;
  if (params.belief_error.any()) {
    MassMotion held;
    held.position = state_.mass_position;
    arms_ = arms_of(ball, held, state_.angular_velocity_B_radps);
    const RollingForces forces = held_forces(ball, held_ball_, state_.orientation, state_.angular_velocity_B_radps);
    drift_held(ball, params, forces);
    errors = held_errors(ball, params.belief_error, arms_, drift_, astray_);
  }
  const ForEver bound = held_for_ever(ball, held_ball_, state_.orientation, state_.angular_velocity_B_radps, errors);
  if (!bound.known) return;
  const Real lightest_kg = held_ball_.mass_kg * (1 - params.belief_error.mass_share);
  const Real most =
      greatest_use(ball, lightest_kg, bound.acceleration_mps2, params.friction, params.min_normal_force_n);
  if (!(most + settling_use_ <= 1 - params.reserve)) return;
  if (!(most <= most_use_)) most_use_ = most;
  end_ = RolloutEnd::kForEver;
}

void Rollout::drift_held(const BallParams& ball, const GovernorParams& params, const RollingForces& forces) {
  drift_of(ball, params.belief_error, arms_, state_.orientation, state_.angular_velocity_B_radps, forces, drift_);
}

void Rollout::step_held_ball(const BallParams& ball, const GovernorParams& params) {
  const Real h = next_step_s(params);
  if (end_ != RolloutEnd::kUnderWay) return;
  const RollingForces forces = held_forces(ball, held_ball_, state_.orientation, state_.angular_velocity_B_radps);
  const Real now =
      std::isinf(params.friction) ? 0 : use_of(params.friction, forces.static_friction_n, forces.normal_force_n);
  Real belief_n = 0, belief_use = 0;
  if (params.belief_error.any()) {
    renewed_ = !renewed_;
    if (renewed_) drift_held(ball, params, forces);
    belief_n = astray_.force_n(drift_);
    if (!std::isinf(params.friction)) belief_use = use_of(params.friction, belief_n, forces.normal_force_n);
    astray_.advance(drift_, h);
  }
  use(params, now + belief_use, forces.normal_force_n);
  if (const Real all = now + belief_use + settling_use_; time_s_ < settled_s_ && !(all <= 1 - params.reserve)) {
    end_ = RolloutEnd::kBroken;
    breach_ = {all / (1 - params.reserve), forces.normal_force_n};
  }
  const Real lightest_n = (1 - params.belief_error.mass_share) * forces.normal_force_n;
  if (!(lightest_n - belief_n >= params.min_normal_force_n)) {
    end_ = RolloutEnd::kBroken;
    breach_ = {now, lightest_n - belief_n};
  }
  // A peak between steps: the parabola through three of them.
  const Real rise = use_at_ - use_before_, fall = use_at_ - now;
  if (use_before_ > 0 && rise >= 0 && fall >= 0 && rise + fall > 0) {
    const Real slope = (rise - fall) / 2;
    use(params, use_at_ + slope * slope / (2 * (rise + fall)) + belief_use, forces.normal_force_n);
  }
  use_before_ = use_at_;
  use_at_ = now;
  step_held(ball, held_ball_, forces, h, state_);
  time_s_ += Wide{h};
}

}  // namespace ballast::firmware
