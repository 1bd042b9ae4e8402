#include "firmware/governor/backup.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "firmware/governor/motor_allowance.h"
#include "firmware/governor/turning.h"

namespace ballast::firmware {

namespace {

// Part of N that the cone keeps free for rounding: the projection stops at 1e-9 of the forces.
constexpr Real kRounding = std::max(Real(1e-7), 1024 * std::numeric_limits<Real>::epsilon());

// Greatest speed from which half of the acceleration stops a mass within `distance`.
Real stoppable(Real distance, Real acceleration) { return distance > 0 ? std::sqrt(acceleration * distance) : 0; }

// The greatest acceleration at the end of a ramp of length h from which it can fade to 0, at nine tenths of max_jerk,
// before the speed has changed by `left` since the ramp's middle.
Real fading(Real max_jerk, Real left, Real h) {
  if (!(left > 0)) return 2 * left / h;
  return 2 * left / (h / 2 + std::sqrt(h * h / 4 + 2 * left / (Real(0.9) * max_jerk)));
}

// A bent command moves the end of a ramp a little, where it is projected anew, in a tick and in a rollout so many
// times.
constexpr int kTickRounds = 3;
// Half spaces of the projections of a tick, after which no further search begins: an empty cone would take hundreds.
constexpr int kTickSteps = 24;
constexpr int kQuickRounds = 1;

// Time constant of the brake, times the natural frequency of a swinging mass: a shorter one excites the swing.
constexpr Real kBrakeSwings = 5;

// A move that is not bent has few short steps.
constexpr Wide kMoveSteps = 3;

// A swing of at most this per step of a rollout is followed by it, in radians. A faster one is over within a few steps.
constexpr Real kSlowSwing = 1;

// Ticks that a rollout takes whose moving ball does so many steps per step_s: for `ticks` of the nominal, for what the
// rollout itself takes, times `own`, for a brake of 12 brake_time_s, and for held steps. 0: it would never end.
int ticks_to_roll(const GovernorParams& params, Wide steps, Wide ticks, Wide own) {
  const Wide per_tick = steps * kMovingStepWork * params.control_period_s / Wide{params.step_s};
  const Wide work = steps * kMovingStepWork * (12 * Wide{params.brake_time_s / params.step_s} + 2) +
                    held_step_work(params) * params.horizon_s / Wide{params.step_s} + 2;
  const Wide share = static_cast<Wide>(params.work_per_tick) - own * per_tick;
  const Wide total = (work + ticks * per_tick) / share;
  constexpr Wide kMost = 1e9;  // that can be counted
  return share > 0 && total < kMost ? static_cast<int>(total) + 1 : 0;
}

}  // namespace

void set_times(const BallParams& ball, Wide control_period_s, GovernorParams& params) {
  const Real unit_s = firmware::unit_s(ball);
  params.control_period_s = control_period_s;
  const Real tick = static_cast<Real>(control_period_s) / unit_s;
  params.tick_slack = tick * tick;
  params.brake_time_s = Real(0.15) * unit_s;
  for (MassLimits& mass : params.mass) {
    const Real natural_radps = mass.swing.natural_radps;
    if (!(natural_radps > 0)) continue;
    mass.lag_s = 2 * mass.swing.damping_ratio / natural_radps;
    params.brake_time_s = std::fmax(params.brake_time_s, kBrakeSwings / natural_radps);
    constexpr Real kTwoPi = Real(6.283185307179586);
    mass.max_jerk = std::fmin(mass.max_jerk, mass.max_acceleration * natural_radps / kTwoPi);
  }
  // A mass that swings about its command takes the ball along, and a candidate begins from the ball of that moment.
  const auto swings_about = [](const MassLimits& mass) { return mass.swing.natural_radps > 0; };
  params.reserve = std::any_of(params.mass.begin(), params.mass.end(), swings_about) ? Real(0.03) : Real(0.01);
  params.moving_reserve = Real(0.014);
  params.step_s = std::fmax(Real(0.05) * unit_s, static_cast<Real>(control_period_s));
  params.horizon_s = Wide{16 * unit_s};
  params.work_per_tick = 3 * kMovingStepWork;
  for (std::size_t i = 0; i < kMaxMasses; ++i) {
    params.still_velocity[i] = Real(1e-3) * std::fmax(params.mass[i].max_acceleration, Real(0)) * params.brake_time_s;
  }
  // The stretch is at least a search, so that the next candidate is complete before the switch.
  const int shortest = static_cast<int>(unit_s / 4 / static_cast<Real>(control_period_s)) + 1;
  // A small ball's time is short beside a tick. Where short steps would never end, fewer are likely.
  for (const Wide steps : {kLikelySteps, kLikelySteps / 2, kLikelySteps / 4}) {
    params.stretch_ticks = shortest;
    params.search_ticks = ticks_to_roll(params, steps, shortest, 1);
    if (params.search_ticks <= shortest && params.search_ticks > 0) return;
    params.search_ticks = params.stretch_ticks = ticks_to_roll(params, steps, 0, 2);
    if (params.search_ticks > 0) return;
  }
}

int ticks_to_certify(const GovernorParams& params, Wide motion_s) {
  return ticks_to_roll(params, kMoveSteps, motion_s / params.control_period_s, 1);
}

MassMotion motion_of(const RobotState& state) {
  MassMotion out;
  out.position = state.mass_position;
  out.velocity = state.mass_velocity;
  return out;
}

MassMotion lagging(const GovernorParams& params, const RobotState& state) {
  MassMotion out;
  for (std::size_t i = 0; i < kMaxMasses; ++i) {
    const Real lag_s = params.mass[i].lag_s;
    out.position[i] = state.mass_position[i] - lag_s * state.mass_velocity[i];
    out.velocity[i] = state.mass_velocity[i] - lag_s * state.mass_acceleration[i];
  }
  return out;
}

Box box_of(const GovernorParams& params, const RobotState& state, int mass_count, Real h_s, Real spare_speed) {
  Box box;
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    const MassLimits& mass = params.mass[i];
    const Real a = mass.max_acceleration, v = state.mass_velocity[i];
    const Real ahead = state.mass_position[i] + v * params.step_s;
    const Real fastest = (stoppable(mass.upper_end - ahead, a) - v) / params.step_s;
    const Real slowest = (-stoppable(ahead - mass.lower_end, a) - v) / params.step_s;
    const Real middle = v + h_s / 2 * state.mass_acceleration[i];
    // The motor's own jerk is more than the max_jerk of a mass that swings.
    const Real jerk = swings(params, i) ? std::numeric_limits<Real>::infinity() : mass.max_jerk;
    const Real most = mass.max_velocity * (1 - spare_speed);
    const Real rise = fading(jerk, most - middle, h_s), fall = fading(jerk, most + middle, h_s);
    box.upper[i] = std::fmax(std::fmin(std::fmin(fastest, rise), a), -a);
    box.lower[i] = std::fmin(std::fmax(std::fmax(slowest, -fall), -a), box.upper[i]);
  }
  return box;
}

Cone cone_of(const GovernorParams& params, const AffineForces& forces, const RobotState& state, int mass_count) {
  Cone cone{params.friction, params.min_normal_force_n, 0};
  if (std::isinf(params.friction)) return cone;
  cone.slack_n = (kRounding + params.tick_slack + params.uncertain) * std::fabs(forces.force_W_n[2]);
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    cone.error[i] = acceleration_error(params.mass[i].swing, state.mass_velocity[i]);
  }
  return cone;
}

PerMass<Real> braking(const GovernorParams& params, const RobotState& state, int mass_count) {
  PerMass<Real> u{};
  const auto tick_s = static_cast<Real>(params.control_period_s);
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    const Real speed = std::fabs(state.mass_velocity[i]);
    const Real rate = std::fmax(speed, params.still_velocity[i]) / params.brake_time_s;
    // From up to sqrt(2 max_jerk speed) the acceleration can fall to 0 with the speed.
    const Real fades = speed > 0 ? std::sqrt(params.mass[i].max_jerk * speed) : 0;
    u[i] = -std::copysign(std::fmin(std::fmin(rate, fades), speed / tick_s), state.mass_velocity[i]);
  }
  return u;
}

void move_masses(int mass_count, Real h_s, RobotState& state) {
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    const Real u = state.mass_acceleration[i];
    state.mass_position[i] += h_s * (state.mass_velocity[i] + h_s * u / 2);
    state.mass_velocity[i] += h_s * u;
  }
}

void brake_masses(const GovernorParams& params, int mass_count, Real h_s, const PerMass<Real>& bend,
                  RobotState& state) {
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    const Real u = state.mass_acceleration[i];
    state.mass_position[i] += h_s * (state.mass_velocity[i] + h_s * u / 2);
    // It brakes with the time constant brake_time_s from the middle of the ramp on.
    state.mass_velocity[i] = (state.mass_velocity[i] + h_s / 2 * (u + bend[i])) / (1 + h_s / (2 * params.brake_time_s));
  }
}

bool still(const GovernorParams& params, const RobotState& state, int mass_count) {
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    if (!(std::fabs(state.mass_velocity[i]) <= params.still_velocity[i])) return false;
  }
  return true;
}

Real use_of(Real friction, Real static_friction_n, Real normal_force_n) {
  if (!(normal_force_n > 0)) return std::numeric_limits<Real>::infinity();
  return static_friction_n / (friction * normal_force_n);
}

bool swings(const GovernorParams& params, std::size_t mass) {
  const Real natural = params.mass[mass].swing.natural_radps;
  return natural > 0 && natural * params.step_s <= kSlowSwing;
}

Real swing_rate(const MotorSwing& swing, Real u, Real swing_acceleration, Real swing_jerk) {
  const Real w = swing.natural_radps;
  return w * w * (u - swing_acceleration) - 2 * swing.damping_ratio * w * swing_jerk;
}

Box near(const Box& box, const PerMass<Real>& u, const PerMass<Real>& change) {
  Box out;
  for (std::size_t i = 0; i < u.size(); ++i) {
    out.lower[i] = std::fmax(box.lower[i], std::fmin(u[i] - change[i], box.upper[i]));
    out.upper[i] = std::fmin(box.upper[i], std::fmax(u[i] + change[i], box.lower[i]));
  }
  return out;
}

namespace {

PerMass<Real> mean(const PerMass<Real>& a, const PerMass<Real>& b) {
  PerMass<Real> out{};
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = (a[i] + b[i]) / 2;
  return out;
}

// The middle of a ramp tick, to the order that the midpoint rule needs.
RobotState middle_of(const BallParams& ball, const RobotState& state, const PerMass<Real>& start,
                     const PerMass<Real>& end, const Vector3& omega_dot_B_radps2, Real h) {
  RobotState middle = state;
  TurningRate change;
  change.add(turning_rate(state.orientation, state.angular_velocity_B_radps, omega_dot_B_radps2, ball.radius_m), h / 2);
  apply(change, middle);
  middle.mass_acceleration = mean(start, end);
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    middle.mass_position[i] += h / 2 * (state.mass_velocity[i] + h * (5 * start[i] + end[i]) / 24);
    middle.mass_velocity[i] += h * (3 * start[i] + end[i]) / 8;
  }
  return middle;
}

RobotState end_of(const BallParams& ball, const RobotState& state, const RobotState& middle, const PerMass<Real>& start,
                  const PerMass<Real>& end, const Vector3& middle_omega_dot_B_radps2, Real h) {
  RobotState out = state;
  TurningRate change;
  change.add(
      turning_rate(middle.orientation, middle.angular_velocity_B_radps, middle_omega_dot_B_radps2, ball.radius_m), h);
  apply(change, out);
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    out.mass_position[i] += h * (state.mass_velocity[i] + h * (2 * start[i] + end[i]) / 6);
    out.mass_velocity[i] += h * (start[i] + end[i]) / 2;
  }
  return out;
}

// Acceleration and jerk of a swinging mass after a ramp of its command, by one step of the classic Runge-Kutta rule.
void swing_over(const MotorSwing& swing, Real start, Real end, Real h, Real& acceleration, Real& jerk) {
  const Real middle = (start + end) / 2, a = acceleration, j = jerk;
  const Real r1 = swing_rate(swing, start, a, j);
  const Real j2 = j + h / 2 * r1, r2 = swing_rate(swing, middle, a + h / 2 * j, j2);
  const Real j3 = j + h / 2 * r2, r3 = swing_rate(swing, middle, a + h / 2 * j2, j3);
  const Real j4 = j + h * r3, r4 = swing_rate(swing, end, a + h * j3, j4);
  acceleration += h / 6 * (j + 2 * j2 + 2 * j3 + j4);
  jerk += h / 6 * (r1 + 2 * r2 + 2 * r3 + r4);
}

// The size of a change of each command that costs the projection 1.
PerMass<Real> units(const GovernorParams& params) {
  PerMass<Real> unit{};
  for (std::size_t i = 0; i < unit.size(); ++i) unit[i] = params.mass[i].max_acceleration;
  return unit;
}

// The cone with a part of the friction kept free.
Cone spare(Cone cone, Real part, const AffineForces& forces) {
  if (!std::isinf(cone.friction)) cone.slack_n += part * cone.friction * std::fabs(forces.force_W_n[2]);
  return cone;
}

// Errors of the belief may add this to the friction, and take it from N. A lighter robot has less of N besides.
void keep_free(const BeliefErrors& errors, Real belief_n, Cone& cone) {
  cone.slack_n += belief_n;
  cone.min_normal_force_n = (cone.min_normal_force_n + belief_n) / (1 - errors.mass_share);
}

// The masses' own accelerations where `u` is commanded.
PerMass<Real> moved(const GovernorParams& params, const RobotState& state, const PerMass<Real>& u, bool swing,
                    int mass_count) {
  PerMass<Real> out = u;
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count) && swing; ++i) {
    if (swings(params, i)) out[i] = state.swing_acceleration[i];
  }
  return out;
}

}  // namespace

AffineForces forces_at(const BallParams& ball, const GovernorParams& params, const RobotState& state) {
  AffineForces forces;
  affine_forces(ball, state.orientation, state.angular_velocity_B_radps, lagging(params, state), forces);
  return forces;
}

void drift_at(const BallParams& ball, const GovernorParams& params, const RobotState& state, const AffineForces& forces,
              bool swing, Drift& out) {
  MassMotion masses = lagging(params, state);
  masses.acceleration = moved(params, state, state.mass_acceleration, swing, ball.mass_count);
  const PerMass<Real>& u = masses.acceleration;
  const Arms arms = arms_of(ball, masses, state.angular_velocity_B_radps);
  const Vector3 force_W_n = forces.force(ball.mass_count, u);
  RollingForces rolling;
  rolling.angular_acceleration_B_radps2 = forces.omega_dot(ball.mass_count, u);
  rolling.normal_force_n = force_W_n[2];
  rolling.static_friction_n = std::sqrt(force_W_n[0] * force_W_n[0] + force_W_n[1] * force_W_n[1]);
  drift_of(ball, params.belief_error, arms, state.orientation, state.angular_velocity_B_radps, rolling, out);
}

RobotState after_ramp(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                      const PerMass<Real>& start, const PerMass<Real>& end, Real h_s) {
  const Vector3 omega_dot = forces_at(ball, params, state).omega_dot(ball.mass_count, start);
  const RobotState middle = middle_of(ball, state, start, end, omega_dot, h_s);
  const Vector3 middle_omega_dot = forces_at(ball, params, middle).omega_dot(ball.mass_count, mean(start, end));
  return end_of(ball, state, middle, start, end, middle_omega_dot, h_s);
}

void governed_for_ramp(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                       const AffineForces& at_start, const Ramp& ramp, const PerMass<Real>& wish, GovernedRamp& out) {
  const Real h = ramp.h_s;
  const int n = ball.mass_count;
  const PerMass<Real> unit = units(params);
  const PerMass<Real> moved_start = moved(params, state, ramp.start, ramp.swing, n);
  const RobotState middle = middle_of(ball, state, ramp.start, wish, at_start.omega_dot(n, moved_start), h);
  const AffineForces in_middle = forces_at(ball, params, middle);
  out.command = {};
  out.command.u = wish;
  out.steps = 0;
  out.belief_n = ramp.belief_n;
  PerMass<Real> moved_end{};
  Real added_n = 0;  // by errors of the command
  bool weighed = false;
  for (int round = 0; round <= (ramp.quick ? kQuickRounds : kTickRounds); ++round) {
    RobotState end = state;
    for (std::size_t i = 0; i < static_cast<std::size_t>(n) && ramp.swing; ++i) {
      if (!swings(params, i)) continue;
      swing_over(params.mass[i].swing, ramp.start[i], out.command.u[i], h, end.swing_acceleration[i],
                 end.swing_jerk[i]);
    }
    moved_end = moved(params, end, out.command.u, ramp.swing, n);
    out.state =
        end_of(ball, end, middle, ramp.start, out.command.u, in_middle.omega_dot(n, mean(moved_start, moved_end)), h);
    out.state.mass_acceleration = out.command.u;
    affine_forces(ball, out.state.orientation, out.state.angular_velocity_B_radps, lagging(params, out.state),
                  out.forces);
    out.cone = cone_of(params, out.forces, out.state, n);
    keep_free(params.belief_error, ramp.belief_n, out.cone);
    added_n = errors_n(out.cone, out.forces, n, out.command.u);
    weighed = true;
    const Cone spared = spare(with_turning(out.cone, out.forces, n, out.command.u, added_n), ramp.spare, out.forces);
    // The last projection's command holds where it lands, too.
    if (round > 0 && !(outside_n(spared, out.forces, n, out.command.u) > 0)) break;
    const int left = ramp.quick ? 0 : std::max(kTickSteps - out.steps, 0);
    const Projection next = project(out.forces, n, spared, ramp.end, unit, wish, left);
    out.steps += next.steps;
    // A search that was cut short found nothing. The last round's command is nearer.
    if (!ramp.quick && round > 0 && left == 0 && next.empty) break;
    out.command = next;
    weighed = !next.bent;
    if (!out.command.bent || out.command.empty) break;
  }
  moved_end = moved(params, out.state, out.command.u, ramp.swing, n);
  out.state.mass_acceleration = out.command.u;
  out.force_W_n = out.forces.force(n, moved_end);
  out.with_errors = added_n > 0 || ramp.belief_n > 0;
  if (!weighed || (ramp.swing && moved_end != out.command.u)) added_n = errors_n(out.cone, out.forces, n, moved_end);
  out.outside_n = most_outside_n(out.cone, out.forces, n, moved_end, added_n);
}

Projection governed_beginning(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                              const PerMass<Real>& wish) {
  const AffineForces forces = forces_at(ball, params, state);
  Cone cone = spare(cone_of(params, forces, state, ball.mass_count), params.moving_reserve, forces);
  if (params.belief_error.any()) {
    Drift drift;
    RobotState begun = state;
    begun.mass_acceleration = wish;
    drift_at(ball, params, begun, forces, false, drift);
    keep_free(params.belief_error, drift.force_n(), cone);
  }
  const Box box = box_of(params, state, ball.mass_count, params.step_s, 0);
  return project(forces, ball.mass_count, cone, box, units(params), wish);
}

Real allowance_of(const GovernorParams& params, const GovernedRamp& end, int mass_count) {
  const Vector3& f = end.force_W_n;
  if (std::isinf(end.cone.friction) || !(f[2] > 0)) return 0;
  return params.uncertain + (end.belief_n + errors_n(end.cone, end.forces, mass_count, end.command.u)) / f[2];
}

}  // namespace ballast::firmware
