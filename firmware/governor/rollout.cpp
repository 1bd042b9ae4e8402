#include "firmware/governor/rollout.h"

#include <cmath>

namespace ballast::firmware {

namespace {

// Near the cone's edge a step is shorter by this: states in which no acceleration keeps the cone may last for less than
// a step, and the projected command turns fast before them.
constexpr Real kEdgeSteps = 4;
constexpr Real kNearEdge = Real(0.97);
// The part of max_jerk that a candidate uses: what the robot can do is more than what it has to.
constexpr Real kJerkUsed = Real(1);

}  // namespace

void Rollout::begin(const GovernorParams& params, const RobotState& state, std::int64_t tick,
                    const Schedule& schedule) {
  end_ = RolloutEnd::kUnderWay;
  state_ = state;
  schedule_ = schedule;
  start_tick_ = tick_ = tick;
  period_s_ = params.control_period_s;
  time_s_ = change_s_ = 0;
  held_ = near_edge_ = wished_ = false;
  most_use_ = 0;
}

// Follows the schedule, and returns how far the next step may go.
Real Rollout::next_step_s(const GovernorParams& params) {
  while (time_s_ >= change_s_) {
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
  const Real step_s = near_edge_ && !held_ ? params.step_s / kEdgeSteps : params.step_s;
  if (last_ && !(left_s > 0)) {
    end_ = RolloutEnd::kHorizon;
    return 0;
  }
  return left_s < Wide{step_s} ? static_cast<Real>(left_s) : step_s;
}

void Rollout::use(const GovernorParams& params, Real use, Real normal_force_n) {
  const Real allowed = held_ ? 1 - params.reserve : 1;
  if (last_ && !(use <= most_use_)) most_use_ = use;
  if (use <= allowed) return;
  end_ = RolloutEnd::kBroken;
  breach_ = {use, normal_force_n};
}

Rollout::Rates Rollout::stage_rates(const BallParams& ball, const GovernorParams& params, const RobotState& at,
                                    const PerMass<Real>& wish, Real reach_s, bool first) {
  if (first && !wished_) last_wish_ = wish;
  wished_ = true;
  // A command changes nearly as fast as max_jerk allows, and the nominal's own changes are followed. At the step's
  // start a tick's change leaves the projection some freedom.
  PerMass<Real> change{};
  const Real time_s = std::fmax(kJerkUsed * reach_s, static_cast<Real>(params.control_period_s));
  // The end of a step may be where the nominal becomes another one, which is no change of its own.
  const bool at_change = !last_ && time_s_ + Wide{reach_s} > change_s_ - period_s_ / 2;
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    const Real bent = params.mass[i].max_jerk * time_s;
    const Real own = nominal_now_ && !at_change ? std::fabs(wish[i] - last_wish_[i]) : 0;
    // The max_jerk of a mass that swings is less than its motor's.
    change[i] = swings(params, i) ? bent + own : std::fmax(bent, own);
  }
  const Governed here = governed_rolling(ball, params, at, wish, change);
  Rates rates;
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    if (!swings(params, i)) continue;
    rates.swing_jerk[i] = at.swing_jerk[i];
    rates.swing_rate[i] =
        swing_rate(params.mass[i].swing, here.command.u[i], at.swing_acceleration[i], at.swing_jerk[i]);
  }
  rates.ball = turning_rate(at.orientation, at.angular_velocity_B_radps, here.omega_dot_B_radps2, ball.radius_m);
  rates.velocity = at.mass_velocity;
  rates.acceleration = here.command.u;
  const Vector3& f = here.force_W_n;
  const Real used =
      std::isinf(params.friction) ? 0 : use_of(params.friction, std::sqrt(f[0] * f[0] + f[1] * f[1]), f[2]);
  if (first && !std::isinf(params.friction)) use(params, used, f[2]);
  if (first) near_edge_ = used > kNearEdge || here.command.bent;
  // No command keeps the reserve. Where masses swing the force is not the command's, and is judged by itself.
  if ((here.command.empty && !here.swings) || (first && !(here.outside_n <= 0))) {
    end_ = RolloutEnd::kBroken;
    breach_ = {used, f[2]};
  }
  return rates;
}

void Rollout::add(const Rates& rates, Real h_s, int mass_count, Rates& sum) {
  sum.ball.add(rates.ball, h_s);
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    sum.velocity[i] += h_s * rates.velocity[i];
    sum.acceleration[i] += h_s * rates.acceleration[i];
    sum.swing_jerk[i] += h_s * rates.swing_jerk[i];
    sum.swing_rate[i] += h_s * rates.swing_rate[i];
  }
}

RobotState Rollout::moved(const RobotState& from, const Rates& rates, Real h_s, int mass_count) {
  RobotState to = from;
  TurningRate change;
  change.add(rates.ball, h_s);
  apply(change, to);
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    to.mass_position[i] += h_s * rates.velocity[i];
    to.mass_velocity[i] += h_s * rates.acceleration[i];
    to.swing_acceleration[i] += h_s * rates.swing_jerk[i];
    to.swing_jerk[i] += h_s * rates.swing_rate[i];
  }
  return to;
}

void Rollout::finish_step(const BallParams& ball, const GovernorParams& params, Real h_s) {
  time_s_ += Wide{h_s};
  if (last_ && still(params, state_, ball.mass_count)) begin_hold(ball, params);
}

void Rollout::begin_hold(const BallParams& ball, const GovernorParams& params) {
  // The linear end of the brake takes brake_time_s and moves a mass by half of that times its velocity.
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    state_.mass_position[i] += state_.mass_velocity[i] * params.brake_time_s / 2;
    state_.mass_velocity[i] = 0;
  }
  held_ = true;
  held_ball_ = hold_masses(ball, state_.mass_position);
  use_before_ = use_at_ = 0;
  const ForEver bound = held_for_ever(ball, held_ball_, state_.orientation, state_.angular_velocity_B_radps);
  if (!bound.known) return;
  const Real most =
      greatest_use(ball, held_ball_.mass_kg, bound.acceleration_mps2, params.friction, params.min_normal_force_n);
  if (!(most <= 1 - params.reserve)) return;
  if (!(most <= most_use_)) most_use_ = most;
  end_ = RolloutEnd::kForEver;
}

void Rollout::step_held_ball(const BallParams& ball, const GovernorParams& params) {
  const Real h = next_step_s(params);
  if (end_ != RolloutEnd::kUnderWay) return;
  const RollingForces forces = held_forces(ball, held_ball_, state_.orientation, state_.angular_velocity_B_radps);
  const Real now =
      std::isinf(params.friction) ? 0 : use_of(params.friction, forces.static_friction_n, forces.normal_force_n);
  use(params, now, forces.normal_force_n);
  if (!(forces.normal_force_n >= params.min_normal_force_n)) {
    end_ = RolloutEnd::kBroken;
    breach_ = {now, forces.normal_force_n};
  }
  // A peak between steps: the parabola through three of them.
  const Real rise = use_at_ - use_before_, fall = use_at_ - now;
  if (use_before_ > 0 && rise >= 0 && fall >= 0 && rise + fall > 0) {
    const Real slope = (rise - fall) / 2;
    use(params, use_at_ + slope * slope / (2 * (rise + fall)), forces.normal_force_n);
  }
  use_before_ = use_at_;
  use_at_ = now;
  step_held(ball, held_ball_, forces, h, state_);
  time_s_ += Wide{h};
}

}  // namespace ballast::firmware
