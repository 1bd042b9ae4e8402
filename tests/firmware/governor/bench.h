// Closed loop of governor and ball with ideal masses: the rolling ball by the firmware's closed forms, one Runge-Kutta
// step per control tick, accelerations linear in a tick. The estimate is the truth.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>

#include "firmware/governor/governor.h"
#include "firmware/model/rolling.h"
#include "firmware/motion/profile.h"
#include "tests/firmware/paper_ball.h"

namespace ballast::firmware::testing {

inline RollingForces forces_of(const BallParams& ball, const RobotState& state, const PerMass<Real>& u) {
  MassMotion masses = motion_of(state);
  masses.acceleration = u;
  return rolling_forces(ball, state.orientation, state.angular_velocity_B_radps, masses);
}

// The state after h, with accelerations that go linearly from state.mass_acceleration to `end`.
inline RobotState moved(const BallParams& ball, const RobotState& state, const PerMass<Real>& end, Real h) {
  const auto acceleration = [&](Real s) {
    PerMass<Real> u = state.mass_acceleration;
    for (std::size_t i = 0; i < u.size(); ++i) u[i] += s / h * (end[i] - u[i]);
    return u;
  };
  const auto at = [&](Real s, const TurningRate& rate) {
    RobotState out = state;
    TurningRate change;
    change.add(rate, s);
    apply(change, out);
    const PerMass<Real> u = acceleration(s);
    for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
      out.mass_position[i] += s * (state.mass_velocity[i] + s * (2 * state.mass_acceleration[i] + u[i]) / 6);
      out.mass_velocity[i] += s * (state.mass_acceleration[i] + u[i]) / 2;
    }
    out.mass_acceleration = u;
    return out;
  };
  const auto rate = [&](const RobotState& x) {
    return turning_rate(x.orientation, x.angular_velocity_B_radps,
                        forces_of(ball, x, x.mass_acceleration).angular_acceleration_B_radps2, ball.radius_m);
  };
  const TurningRate a = rate(state), b = rate(at(h / 2, a)), c = rate(at(h / 2, b)), d = rate(at(h, c));
  TurningRate mean;
  mean.add(a, Real(1) / 6), mean.add(b, Real(1) / 3), mean.add(c, Real(1) / 3), mean.add(d, Real(1) / 6);
  return at(h, mean);
}

// A tick from this state, in which the masses keep their limits. `jump`: the changes of the motion's own accelerations,
// which are followed.
inline Ramp ramp_of(const BallParams& ball, const GovernorParams& params, const RobotState& state,
                    const PerMass<Real>& jump = {}) {
  Ramp ramp;
  ramp.h_s = static_cast<Real>(params.control_period_s);
  ramp.start = state.mass_acceleration;
  PerMass<Real> change{};
  for (std::size_t i = 0; i < change.size(); ++i) {
    const Real own = params.jumps ? std::fabs(jump[i]) : 0;
    const Real most = std::fmax(params.mass[i].motor_jerk * ramp.h_s, own);
    change[i] = std::fmin(params.mass[i].max_jerk * ramp.h_s + own, most);
  }
  ramp.end = near(box_of(params, state, ball.mass_count, ramp.h_s, 0), ramp.start, change);
  return ramp;
}

inline PerMass<Real> difference(const PerMass<Real>& a, const PerMass<Real>& b) {
  PerMass<Real> out{};
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = a[i] - b[i];
  return out;
}

// Follows profiles from a tick on: u = theta'' + 2 w (theta' - v) + w^2 (theta - p).
struct ProfileLaw {
  const BallParams* ball;
  const PerMass<Profile>* profiles;
  Real bandwidth_radps;
  Wide start_s = 0;  // profile time at time 0 of the call

  Wish operator()(Wide time_s, const RobotState& state) const {
    Wish wish;
    for (std::size_t i = 0; i < static_cast<std::size_t>(ball->mass_count); ++i) {
      const ProfilePoint p = (*profiles)[i].at(start_s + time_s);
      const Real w = bandwidth_radps;
      wish.own[i] = static_cast<Real>(p.acceleration);
      wish.u[i] = wish.own[i] + 2 * w * (static_cast<Real>(p.velocity) - state.mass_velocity[i]) +
                  w * w * (static_cast<Real>(p.position) - state.mass_position[i]);
    }
    return wish;
  }
};

// Robot, limits, motion and governor in a closed loop. Ticks count from 0, where the motion starts.
struct Bench {
  BallParams ball;
  GovernorParams params;
  PerMass<Profile> motion{};
  Real bandwidth_radps = 1;
  RobotState state;
  GovernorState governor;
  GovernorOutput out;
  std::int64_t tick = 0;
  int spent = 0;  // of each tick's work, by others

  // Seen so far.
  int bent = 0, backup = 0, empty = 0;
  Real most_use = 0;  // f_s / (friction N), at both ends of every tick; infinite where N <= 0
  PerMass<Real> largest_bend{};

  [[nodiscard]] ProfileLaw law(std::int64_t from_tick) const {
    return {&ball, &motion, bandwidth_radps, static_cast<Wide>(from_tick) * params.control_period_s};
  }

  // Certifies the start, as the controller does while it waits for it: the whole motion first, then shorter stretches.
  // False: no backup could be certified.
  [[nodiscard]] bool start() {
    Wide end_s = 0;
    bool rests = true;
    for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
      end_s = std::fmax(end_s, motion[i].end_s());
      rests = rests && motion[i].final_velocity() == 0;
    }
    state.mass_acceleration = governed_beginning(ball, params, state, law(0)(0, state).u).u;
    const auto end_tick = rests ? static_cast<std::int64_t>(end_s / params.control_period_s) + 1 : 0;
    for (int attempt = rests ? kStartStretches : kStartStretches - 1; attempt >= 0; --attempt) {
      begin_start(params, state, 0, 0, end_tick, attempt, governor);
      governor.candidate.advance(ball, params, law(0), governor.bends, 1000000);
      if (governor.candidate.end() != RolloutEnd::kBroken) return true;
    }
    return false;
  }

  void judge(const RobotState& at, const PerMass<Real>& u) {
    const RollingForces f = forces_of(ball, at, u);
    most_use = std::fmax(most_use, use_of(params.friction, f.static_friction_n, f.normal_force_n));
  }

  // One tick with the wish of `nominal(time after 0, state)`.
  template <class Nominal>
  void step(const Nominal& nominal) {
    const auto period_s = static_cast<Wide>(params.control_period_s);
    const auto law_of_candidate = [&](Wide time_s, const RobotState& at) {
      return nominal(time_s + static_cast<Wide>(governor.candidate.start_tick()) * period_s, at);
    };
    RobotState ahead = state;
    move_masses(ball.mass_count, static_cast<Real>(period_s), ahead);
    const Wish wish = nominal(static_cast<Wide>(tick + 1) * period_s, ahead);
    const bool follows = governor.mode == GovernorMode::kNominal;
    const Ramp ramp = ramp_of(
        ball, params, state,
        follows ? difference(wish.own, nominal(static_cast<Wide>(tick) * period_s, state).own) : PerMass<Real>{});
    NominalEnd end;
    end.wish = end.reached = wish.u;
    for (std::size_t i = 0; i < end.reached.size(); ++i) {
      end.reached[i] = std::fmin(std::fmax(end.reached[i], ramp.end.lower[i]), ramp.end.upper[i]);
    }
    govern(ball, params, state, state, ramp, end, law_of_candidate, tick, spent, governor, out);
    bent += out.report.bent ? 1 : 0;
    backup += out.report.backup ? 1 : 0;
    empty += out.report.empty ? 1 : 0;
    judge(state, state.mass_acceleration);
    state = moved(ball, state, out.acceleration, static_cast<Real>(period_s));
    judge(state, out.acceleration);
    ++tick;
    for (std::size_t i = 0; i < static_cast<std::size_t>(ball.mass_count); ++i) {
      const Wide off = state.mass_position[i] - motion[i].at(static_cast<Wide>(tick) * period_s).position;
      largest_bend[i] = std::fmax(largest_bend[i], static_cast<Real>(std::fabs(off)));
    }
  }
  void step() { step(law(0)); }

  [[nodiscard]] Real bend() const { return *std::max_element(largest_bend.begin(), largest_bend.end()); }
};

// The certificate's plan, run to its end from where the bench is: the nominal up to its switch, then the backup. Where
// it holds for ever, for 2.5 horizons after the switch.
struct ExecutedPlan {
  Real most_use = 0;    // f_s / (friction N)
  Real backup_use = 0;  // the same while the backup runs
  std::int64_t backup_use_tick = 0;
};

inline ExecutedPlan execute_plan(const Bench& bench) {
  const Certificate& certificate = bench.governor.certificate;
  const Bends& bends = bench.governor.bends;
  const Wide period_s = bench.params.control_period_s;
  const auto long_ticks = static_cast<std::int64_t>(Wide(2.5) * bench.params.horizon_s / period_s);
  const std::int64_t until = certificate.until_tick == kForEverTick
                                 ? std::max(certificate.switch_tick, bench.tick) + long_ticks
                                 : certificate.until_tick;
  ExecutedPlan out;
  RobotState state = bench.state;
  for (std::int64_t tick = bench.tick; tick < until; ++tick) {
    const bool nominal = bench.governor.mode == GovernorMode::kNominal && tick < certificate.switch_tick;
    RobotState ahead = state;
    const int n = bench.ball.mass_count;
    PerMass<Real> wish{}, jump{};
    const PerMass<Real> bend = bends.at(static_cast<Wide>(tick + 1 - bends.start_tick()) * period_s, period_s);
    if (nominal) {
      move_masses(n, static_cast<Real>(period_s), ahead);
      const Wish end = bench.law(tick + 1)(0, ahead);
      wish = end.u;
      jump = difference(end.own, bench.law(tick)(0, state).own);
    } else {
      brake_masses(bench.params, n, static_cast<Real>(period_s), bend, ahead);
      wish = braking(bench.params, ahead, n);
    }
    const Ramp ramp = ramp_of(bench.ball, bench.params, state, jump);
    for (std::size_t i = 0; i < wish.size(); ++i) {
      wish[i] = std::fmin(std::fmax(wish[i] + bend[i], ramp.end.lower[i]), ramp.end.upper[i]);
    }
    GovernedRamp now;
    governed_for_ramp(bench.ball, bench.params, state, forces_at(bench.ball, bench.params, state), ramp, wish, now);
    state = moved(bench.ball, state, now.command.u, static_cast<Real>(period_s));
    const RollingForces f = forces_of(bench.ball, state, state.mass_acceleration);
    const Real use = use_of(bench.params.friction, f.static_friction_n, f.normal_force_n);
    out.most_use = std::fmax(out.most_use, use);
    if (nominal || use < out.backup_use) continue;
    out.backup_use = use;
    out.backup_use_tick = tick;
  }
  return out;
}

// sim/scenarios/paper_ball.toml with ideal masses.
inline std::unique_ptr<Bench> paper_bench(Real friction) {
  auto bench = std::make_unique<Bench>();
  const auto params = std::make_unique<ControllerParams>(paper_params());
  bench->ball = paper_ball();
  bench->motion = params->motion;
  bench->params.friction = friction;
  constexpr Real kNone = std::numeric_limits<Real>::infinity();
  for (std::size_t i = 0; i < 3; ++i) {
    bench->params.mass[i] = {5, 2, -kNone, kNone, {}};
    bench->state.mass_position[i] = static_cast<Real>(kPaperStart[i]);
  }
  set_times(bench->ball, Wide{0.001}, bench->params);
  return bench;
}

// sim/scenarios/desk_ball.toml with ideal masses.
inline std::unique_ptr<Bench> desk_bench(Real friction) {
  auto bench = std::make_unique<Bench>();
  BallParams& ball = bench->ball;
  ball.radius_m = Real(0.15);
  ball.gravity_mps2 = Real(9.81);
  ball.shell_mass_kg = Real(0.8);
  ball.inertia_kgm2 = Vector3::Constant(Real(0.0118));
  ball.mass_count = 3;
  ball.mass_kg = {Real(0.28), Real(0.28), Real(0.28)};
  const Vector3 down(0, 0, -1);
  ball.rail[0] = circle(Vector3(0, Real(-0.06), 0), Real(0.095), down, Vector3(1, 0, 0));
  ball.rail[1] = circle(Vector3(0, Real(0.06), 0), Real(0.095), down, Vector3(1, 0, 0));
  ball.rail[2] = circle(Vector3(0, 0, Real(0.03)), Real(0.05), down, Vector3(0, 1, 0));
  constexpr ProfilePiece kDrive[5] = {{1.6, 0, 0.8}, {1.6, 0.8, 0}, {1, 0, 0}, {1.6, 0, -0.8}, {1.6, -0.8, 0}};
  constexpr ProfilePiece kSteer[3] = {{1, 0, 0.2}, {2, 0.2, -0.2}, {1, -0.2, 0}};
  for (std::size_t i = 0; i < 2; ++i) static_cast<void>(bench->motion[i].set(0, 0, kDrive, 5));
  static_cast<void>(bench->motion[2].set(0, 0, kSteer, 3));
  bench->bandwidth_radps = 8;
  bench->params.friction = friction;
  constexpr Real kNone = std::numeric_limits<Real>::infinity();
  for (std::size_t i = 0; i < 3; ++i) bench->params.mass[i] = {10, 20, -kNone, kNone, {}};
  set_times(ball, Wide{0.001}, bench->params);
  return bench;
}

}  // namespace ballast::firmware::testing
