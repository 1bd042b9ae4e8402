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

// An acceleration that fades at max_jerk while the speed changes by less than `left`. 2 would be the most.
Real fading(Real max_jerk, Real left) { return left > 0 ? std::sqrt(Real(1.8) * max_jerk * left) : 0; }

// The change of the force within a tick depends a little on the command. The slack allows for that much more of what
// the tick's end is outside.
constexpr Real kMoreSlack = Real(0.25);
constexpr int kTickRounds = 3;

// Time constant of the brake, times the natural frequency of a swinging mass: a shorter one excites the swing.
constexpr Real kBrakeSwings = 5;

// A swing of at most this per step of a rollout is followed by it, in radians. A faster one is over within a few steps.
constexpr Real kSlowSwing = 1;

RobotState after_tick(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                      const Governed& now) {
  const auto h = static_cast<Real>(params.control_period_s);
  RobotState end = state;
  TurningRate change;
  change.add(turning_rate(state.orientation, state.angular_velocity_B_radps, now.omega_dot_B_radps2, ball.radius_m), h);
  apply(change, end);
  for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
    end.mass_position[i] += h * (state.mass_velocity[i] + h * now.command.u[i] / 2);
    end.mass_velocity[i] += h * now.command.u[i];
  }
  return end;
}

}  // namespace

void set_times(const BallParams& ball, Wide control_period_s, GovernorParams& params) {
  const Real unit_s = ball.gravity_mps2 > 0 ? std::sqrt(ball.radius_m / ball.gravity_mps2) : Real(1);
  params.control_period_s = control_period_s;
  const Real tick = static_cast<Real>(control_period_s) / unit_s;
  params.tick_slack = tick * tick;
  params.brake_time_s = Real(0.15) * unit_s;
  for (MassLimits& mass : params.mass) {
    const Real natural_radps = mass.swing.natural_radps;
    if (!(natural_radps > 0)) continue;
    params.brake_time_s = std::fmax(params.brake_time_s, kBrakeSwings / natural_radps);
    constexpr Real kTwoPi = Real(6.283185307179586);
    mass.max_jerk = std::fmin(mass.max_jerk, mass.max_acceleration * natural_radps / kTwoPi);
  }
  params.reserve = Real(0.01);
  params.moving_reserve = Real(0.01);
  params.step_s = std::fmax(Real(0.05) * unit_s, static_cast<Real>(control_period_s));
  params.horizon_s = Wide{16 * unit_s};
  params.work_per_tick = 2 * kMovingStepWork;
  params.stretch_ticks = static_cast<int>(2 * unit_s / static_cast<Real>(control_period_s));
  for (std::size_t i = 0; i < kMaxMasses; ++i) {
    params.still_velocity[i] = Real(1e-3) * std::fmax(params.mass[i].max_acceleration, Real(0)) * params.brake_time_s;
  }
  // Moving steps: the nominal stretch (2 search_ticks) and a brake of 12 brake_time_s; held steps: the horizon. The
  // stretch grows with the search, so the search solves s = (2 s dt / h + brake) work + held.
  const Wide per_step = static_cast<Wide>(control_period_s) / Wide{params.step_s};
  const Wide moving = 12 * Wide{params.brake_time_s / params.step_s} + 2;
  const Wide held = params.horizon_s / Wide{params.step_s} + 2;
  const Wide work = kMovingStepWork * moving + held;
  // Near the cone's edge steps are shorter, so a search may take kEdgeWork as much.
  constexpr Wide kEdgeWork = 6.5;
  const Wide share = static_cast<Wide>(params.work_per_tick) - 2 * kMovingStepWork * per_step;
  params.search_ticks = share > 0 ? static_cast<int>(kEdgeWork * work / share) + 1 : 0;
}

MassMotion motion_of(const RobotState& state) {
  MassMotion out;
  out.position = state.mass_position;
  out.velocity = state.mass_velocity;
  return out;
}

Box box_of(const GovernorParams& params, const RobotState& state, int mass_count, Real within_s) {
  Box box;
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    const MassLimits& mass = params.mass[i];
    const Real a = mass.max_acceleration, v = state.mass_velocity[i];
    const Real ahead = state.mass_position[i] + v * within_s;
    const Real fastest = std::fmin(mass.max_velocity, stoppable(mass.upper_end - ahead, a));
    const Real slowest = -std::fmin(mass.max_velocity, stoppable(ahead - mass.lower_end, a));
    const Real rise = fading(mass.max_jerk, mass.max_velocity - v), fall = fading(mass.max_jerk, mass.max_velocity + v);
    box.upper[i] = std::fmax(std::fmin(std::fmin((fastest - v) / within_s, rise), a), -a);
    box.lower[i] = std::fmin(std::fmax(std::fmax((slowest - v) / within_s, -fall), -a), box.upper[i]);
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

Governed governed(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                  const PerMass<Real>& wish, Real within_s, Real slack_n) {
  AffineForces forces;
  affine_forces(ball, state.orientation, state.angular_velocity_B_radps, motion_of(state), forces);
  PerMass<Real> unit{};
  for (std::size_t i = 0; i < unit.size(); ++i) unit[i] = params.mass[i].max_acceleration;
  Governed out;
  out.cone = cone_of(params, forces, state, ball.mass_count);
  out.cone.slack_n += slack_n;
  out.command =
      project(forces, ball.mass_count, out.cone, box_of(params, state, ball.mass_count, within_s), unit, wish);
  out.force_W_n = forces.force(ball.mass_count, out.command.u);
  out.outside_n = outside_n(out.cone, forces, ball.mass_count, out.command.u);
  out.omega_dot_B_radps2 = forces.omega_dot(ball.mass_count, out.command.u);
  return out;
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

Governed governed_rolling(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                          const PerMass<Real>& wish, const PerMass<Real>& change) {
  AffineForces forces;
  affine_forces(ball, state.orientation, state.angular_velocity_B_radps, motion_of(state), forces);
  const int n = ball.mass_count;
  PerMass<Real> unit{};
  for (std::size_t i = 0; i < unit.size(); ++i) unit[i] = params.mass[i].max_acceleration;
  Governed out;
  out.cone = cone_of(params, forces, state, n);
  const Cone whole = out.cone;
  if (!std::isinf(params.friction)) {
    out.cone.slack_n += params.moving_reserve * params.friction * std::fabs(forces.force_W_n[2]);
  }
  const Box box = near(box_of(params, state, n, params.step_s), state.mass_acceleration, change);
  out.command = project(forces, n, out.cone, box, unit, wish);
  PerMass<Real> moved = out.command.u;
  for (std::size_t i = 0; i < static_cast<std::size_t>(n); ++i) {
    if (!swings(params, i)) continue;
    moved[i] = state.swing_acceleration[i];
    out.swings = true;
  }
  out.force_W_n = forces.force(n, moved);
  out.outside_n = outside_n(whole, forces, n, moved);
  out.omega_dot_B_radps2 = forces.omega_dot(n, moved);
  return out;
}

Governed governed_for_tick(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                           const PerMass<Real>& wish) {
  Governed out = governed(ball, params, state, wish, params.step_s);
  Real slack_n = 0;
  for (int round = 0; round < kTickRounds; ++round) {
    AffineForces at_end;
    const RobotState end = after_tick(ball, params, state, out);
    affine_forces(ball, end.orientation, end.angular_velocity_B_radps, motion_of(end), at_end);
    // Outside of the cone without the slack, at the tick's two ends.
    const Real start_n = out.outside_n - slack_n;
    const Real end_n = outside_n(out.cone, at_end, ball.mass_count, out.command.u) - slack_n;
    if (!(end_n > 0)) break;
    slack_n = (end_n - start_n) + kMoreSlack * end_n;
    out = governed(ball, params, state, wish, params.step_s, slack_n);
  }
  return out;
}

namespace {

// The middle of a ramp tick, to the order that the midpoint rule needs.
RobotState middle_of(const BallParams& ball, const RobotState& state, const PerMass<Real>& start,
                     const PerMass<Real>& end, const Vector3& omega_dot_B_radps2, Real h) {
  RobotState middle = state;
  TurningRate change;
  change.add(turning_rate(state.orientation, state.angular_velocity_B_radps, omega_dot_B_radps2, ball.radius_m), h / 2);
  apply(change, middle);
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

PerMass<Real> mean(const PerMass<Real>& a, const PerMass<Real>& b) {
  PerMass<Real> out{};
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = (a[i] + b[i]) / 2;
  return out;
}

// What motors and errors may add to f_s - kappa N along the friction, as a part of N.
Real allowance_of(const GovernorParams& params, const AffineForces& forces, const Cone& cone, const Vector3& f,
                  int mass_count) {
  if (std::isinf(cone.friction) || !(f[2] > 0)) return 0;
  const Real size = std::sqrt(f[0] * f[0] + f[1] * f[1]);
  const Real x = size > 0 ? f[0] / size : 1, y = size > 0 ? f[1] / size : 0;
  Real sum = params.uncertain * f[2];
  for (std::size_t i = 0; i < static_cast<std::size_t>(mass_count); ++i) {
    const Vector3& per_unit = forces.force_per_unit[i];
    sum += cone.error[i] * std::fabs(x * per_unit[0] + y * per_unit[1] - cone.friction * per_unit[2]);
  }
  return sum / f[2];
}

}  // namespace

RobotState after_ramp(const BallParams& ball, const RobotState& state, const PerMass<Real>& start,
                      const PerMass<Real>& end, Real h_s) {
  AffineForces forces;
  affine_forces(ball, state.orientation, state.angular_velocity_B_radps, motion_of(state), forces);
  const RobotState middle = middle_of(ball, state, start, end, forces.omega_dot(ball.mass_count, start), h_s);
  affine_forces(ball, middle.orientation, middle.angular_velocity_B_radps, motion_of(middle), forces);
  return end_of(ball, state, middle, start, end, forces.omega_dot(ball.mass_count, mean(start, end)), h_s);
}

GovernedRamp governed_for_ramp(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                               const Ramp& ramp, const PerMass<Real>& wish) {
  const auto h = static_cast<Real>(params.control_period_s);
  const int n = ball.mass_count;
  PerMass<Real> unit{};
  for (std::size_t i = 0; i < unit.size(); ++i) unit[i] = params.mass[i].max_acceleration;
  GovernedRamp out;
  Governed& end = out.end;
  end.command.u = wish;
  AffineForces forces, in_middle;
  affine_forces(ball, state.orientation, state.angular_velocity_B_radps, motion_of(state), forces);
  const RobotState middle = middle_of(ball, state, ramp.start, wish, forces.omega_dot(n, ramp.start), h);
  affine_forces(ball, middle.orientation, middle.angular_velocity_B_radps, motion_of(middle), in_middle);
  // A command that is bent moves the end of the tick a little, where it is then projected anew.
  for (int round = 0; round <= kTickRounds; ++round) {
    out.state = end_of(ball, state, middle, ramp.start, end.command.u,
                       in_middle.omega_dot(n, mean(ramp.start, end.command.u)), h);
    affine_forces(ball, out.state.orientation, out.state.angular_velocity_B_radps, motion_of(out.state), forces);
    end.cone = cone_of(params, forces, out.state, n);
    // What the last projection gave holds where it lands, too.
    if (round > 0 && !(outside_n(end.cone, forces, n, end.command.u) > 0)) break;
    end.command = project(forces, n, end.cone, ramp.end, unit, wish);
    if (!end.command.bent) break;
  }
  end.force_W_n = forces.force(n, end.command.u);
  end.outside_n = outside_n(end.cone, forces, n, end.command.u);
  end.omega_dot_B_radps2 = forces.omega_dot(n, end.command.u);
  out.allowance = allowance_of(params, forces, end.cone, end.force_W_n, n);
  return out;
}

}  // namespace ballast::firmware
