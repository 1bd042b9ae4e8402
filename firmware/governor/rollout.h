// Rolls a candidate forward: the nominal for a stretch, then the backup, to a horizon. A few steps per control tick.
//
// Invariants: fixed size, no heap; one call does at most the work that the caller allows.
#pragma once

#include "firmware/governor/backup.h"
#include "firmware/governor/bends.h"
#include "firmware/governor/held_ball.h"
#include "firmware/governor/turning.h"

namespace ballast::firmware {

// A moving ball's shortest step is GovernorParams::step_s over this.
inline constexpr Real kEdgeSteps = 4;

// Ticks in which a candidate follows the nominal: before `until`, and from `from` to before `to`. Otherwise the backup.
struct Schedule {
  std::int64_t until = 0;
  std::int64_t from = 0;
  std::int64_t to = 0;

  [[nodiscard]] bool nominal(std::int64_t tick) const { return tick < until || (tick >= from && tick < to); }
  // The tick from which the backup runs to the end.
  [[nodiscard]] std::int64_t backup_from() const { return from < to && to > until ? to : until; }
  // The first tick after `tick` at which the candidate changes, or may change its nominal (at `from`). backup_from() is
  // the last.
  [[nodiscard]] std::int64_t next_change(std::int64_t tick) const {
    if (tick < from && (from <= until || tick >= until)) return from;
    if (tick < until && !(to > until && from <= until)) return until;
    return to;
  }
};

enum class RolloutEnd : std::uint8_t {
  kUnderWay,
  kForEver,  // kept the cone up to a state from which held masses keep it for ever
  kHorizon,  // kept the cone up to the horizon
  kBroken,   // left it
};

// The force with which a rollout ended: > 1 of the friction where it left the cone.
struct Breach {
  // Part of the friction that was free, allowances and reserves taken off; infinite where N <= 0. 0: there was no room
  // for the plan's bends.
  Real use = 0;
  Real normal_force_n = 0;  // N
};

// A wish at a time.
struct Wish {
  PerMass<Real> u{};    // accelerations
  PerMass<Real> own{};  // of these the motion's, whose changes may be followed faster than max_jerk
};

class Rollout {
 public:
  // From `state` at the start of `tick`.
  void begin(const GovernorParams& params, const RobotState& state, std::int64_t tick, const Schedule& schedule);

  // Does steps while their cost so far is below `work`: kMovingStepWork for one that is not bent, held_step_work() for
  // a held ball.
  // `nominal(time_s, state)` returns the Wish at a time after the start of begin()'s tick. `in_force`: the bends of the
  // certificate in force, which the ball follows up to the tick Schedule::from, or for ever where there is none.
  template <class Nominal>
  void advance(const BallParams& ball, const GovernorParams& params, const Nominal& nominal, const Bends& in_force,
               int work) {
    for (int left = work; left > 0 && end_ == RolloutEnd::kUnderWay;) {
      if (held_) {
        step_held_ball(ball, params);
        left -= held_step_work(params);
      } else {
        // To take up another wish, or to hold the masses, costs as much as a step.
        const int once = wished_ ? 0 : 1;
        step_moving(ball, params, nominal, in_force);
        left -= kMovingStepWork * (cost_ + once + (held_ ? 1 : 0));
      }
    }
  }

  // Up to this time after the start the wish is neither bent into the cone nor held to the limits of a bend: where it
  // leaves the cone, the rollout is broken.
  void refuse_bends(Wide until_s) { bends_from_s_ = until_s; }

  // Only where the ball goes is asked for, not whether it keeps the cone: the rollout goes on where that breaks, its
  // steps are longer, and bends() stays empty.
  void tell_way() { tells_way_ = true; }

  [[nodiscard]] RolloutEnd end() const { return end_; }
  [[nodiscard]] const Schedule& schedule() const { return schedule_; }
  [[nodiscard]] std::int64_t start_tick() const { return start_tick_; }
  // Least 1 - f_s / (friction N) since backup_from().
  [[nodiscard]] Real margin() const { return 1 - most_use_; }
  // Time after the start: of the end, or how far it has come.
  [[nodiscard]] Wide time_s() const { return time_s_; }
  [[nodiscard]] const RobotState& state() const { return state_; }
  // Valid at the end kBroken.
  [[nodiscard]] const Breach& breach() const { return breach_; }
  // The cost of the last step of a moving ball, in steps that are not bent.
  [[nodiscard]] int cost() const { return cost_; }
  // Commands less their wishes: the nominal where the schedule has it, else braking().
  [[nodiscard]] const Bends& bends() const { return bends_; }

 private:
  template <class Nominal>
  Wish wish(const BallParams& ball, const GovernorParams& params, const Nominal& nominal, Wide time_s,
            const RobotState& at) const {
    if (nominal_now_) return nominal(time_s, at);
    return {braking(params, at, ball.mass_count), {}};
  }

  template <class Nominal>
  void step_moving(const BallParams& ball, const GovernorParams& params, const Nominal& nominal,
                   const Bends& in_force) {
    const Real h = next_step_s(params);
    if (end_ != RolloutEnd::kUnderWay) return;
    if (!wished_) begin_wish(ball, params, wish(ball, params, nominal, time_s_, state_));
    planned_ = guide(in_force, time_s_ + Wide{h});
    finish_step(ball, params, wish(ball, params, nominal, time_s_ + Wide{h}, ahead(ball, params, h)), h);
  }

  Real next_step_s(const GovernorParams& params);
  void begin_wish(const BallParams& ball, const GovernorParams& params, const Wish& wish);
  // The schedule follows the certificate in force at a time after the start.
  [[nodiscard]] bool guided(Wide time_s) const;
  [[nodiscard]] PerMass<Real> guide(const Bends& in_force, Wide time_s) const;
  // The state after h, to first order.
  [[nodiscard]] RobotState ahead(const BallParams& ball, const GovernorParams& params, Real h_s) const;
  [[nodiscard]] bool follows_wish(const GovernorParams& params, std::size_t i) const;
  void finish_step(const BallParams& ball, const GovernorParams& params, const Wish& wish, Real h_s);
  void keep(const PerMass<Real>& bend);
  void bend(const BallParams& ball, const PerMass<Real>& wish);
  void judge(const GovernorParams& params, const GovernedRamp& end);
  [[nodiscard]] Real settling_use(const BallParams& ball, const GovernorParams& params) const;
  void begin_hold(const BallParams& ball, const GovernorParams& params);
  void drift_held(const BallParams& ball, const GovernorParams& params, const RollingForces& forces);
  void step_held_ball(const BallParams& ball, const GovernorParams& params);
  void use(const GovernorParams& params, Real use, Real normal_force_n);

  RolloutEnd end_ = RolloutEnd::kBroken;
  RobotState state_;
  Schedule schedule_;
  std::int64_t start_tick_ = 0, tick_ = 0;  // tick_: the last change of the schedule
  Wide period_s_ = 0, time_s_ = 0, change_s_ = 0;
  bool nominal_now_ = false, last_ = false;
  bool begun_ = false;   // forces_ are those of state_
  bool wished_ = false;  // last_wish_ is that of state_, by the same wish
  Wish last_wish_;
  PerMass<Real> bent_{};     // at state_, as far as it is likely to last
  PerMass<Real> planned_{};  // at the end of the step by the certificate in force
  AffineForces forces_;      // at state_, of a moving ball
  Bends bends_;
  bool held_ = false;
  bool near_edge_ = false;
  bool tells_way_ = false;
  Wide bends_from_s_ = 0;
  int cost_ = 1;
  HeldBall held_ball_;
  // Where errors of the belief are declared: the drift is renewed in every second step, and is used in both.
  Astray astray_;
  Drift drift_;
  bool renewed_ = false;  // in the last step
  Arms arms_;             // of the held ball
  // Part of the friction that the motors may add until the slowest masses have come to rest.
  Real settling_use_ = 0;
  Wide settled_s_ = 0;
  Real most_use_ = 0;
  Breach breach_;
  Real use_before_ = 0, use_at_ = 0;  // f_s / (friction N) at the last two steps of a held ball
};

}  // namespace ballast::firmware
