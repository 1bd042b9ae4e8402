// Rolls a candidate forward: the nominal for a stretch, then the backup, to a horizon. A few steps per control tick.
//
// Invariants: fixed size, no heap; one call does at most the work that the caller allows.
#pragma once

#include "firmware/governor/backup.h"
#include "firmware/governor/held_ball.h"
#include "firmware/governor/turning.h"

namespace ballast::firmware {

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

// Where a rollout left the cone.
struct Breach {
  Real use = 0;             // f_s / (friction N); infinite where N <= 0
  Real normal_force_n = 0;  // N
};

class Rollout {
 public:
  // From `state` at the start of `tick`.
  void begin(const GovernorParams& params, const RobotState& state, std::int64_t tick, const Schedule& schedule);

  // Does steps worth at most `work` (kMovingStepWork, 1 for a held ball), and at least one. `nominal(time_s, state)`
  // returns the wished accelerations, PerMass<Real>, at a time after the start of begin()'s tick.
  template <class Nominal>
  void advance(const BallParams& ball, const GovernorParams& params, const Nominal& nominal, int work) {
    for (int left = work; left > 0 && end_ == RolloutEnd::kUnderWay;) {
      if (held_) {
        step_held_ball(ball, params);
        --left;
      } else {
        step_moving(ball, params, nominal);
        left -= kMovingStepWork;
      }
    }
  }

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

 private:
  // Rates of everything in a moving ball.
  struct Rates {
    TurningRate ball;
    PerMass<Real> velocity{}, acceleration{}, swing_jerk{}, swing_rate{};
  };

  template <class Nominal>
  void step_moving(const BallParams& ball, const GovernorParams& params, const Nominal& nominal) {
    const Real h = next_step_s(params);
    if (held_ || end_ != RolloutEnd::kUnderWay) return;
    const RobotState start = state_;
    RobotState at = start;
    Rates sum;
    for (int stage = 0; stage < 4; ++stage) {
      const Real reach = stage == 0 ? 0 : (stage == 3 ? h : h / 2);
      const PerMass<Real> wish =
          nominal_now_ ? nominal(time_s_ + Wide{reach}, at) : braking(params, at, ball.mass_count);
      const Rates rates = stage_rates(ball, params, at, wish, reach, stage == 0);
      add(rates, stage == 0 || stage == 3 ? h / 6 : h / 3, ball.mass_count, sum);
      last_command_ = rates.acceleration;
      if (stage == 3) last_wish_ = wish;
      if (stage < 3) at = moved(start, rates, stage == 2 ? h : h / 2, ball.mass_count);
    }
    state_ = moved(start, sum, 1, ball.mass_count);
    state_.mass_acceleration = last_command_;
    finish_step(ball, params, h);
  }

  Real next_step_s(const GovernorParams& params);
  Rates stage_rates(const BallParams& ball, const GovernorParams& params, const RobotState& at,
                    const PerMass<Real>& wish, Real reach_s, bool first);
  static void add(const Rates& rates, Real h_s, int mass_count, Rates& sum);
  static RobotState moved(const RobotState& from, const Rates& rates, Real h_s, int mass_count);
  void finish_step(const BallParams& ball, const GovernorParams& params, Real h_s);
  void begin_hold(const BallParams& ball, const GovernorParams& params);
  void step_held_ball(const BallParams& ball, const GovernorParams& params);
  void use(const GovernorParams& params, Real use, Real normal_force_n);

  RolloutEnd end_ = RolloutEnd::kBroken;
  RobotState state_;
  Schedule schedule_;
  std::int64_t start_tick_ = 0, tick_ = 0;  // tick_: the last change of the schedule
  Wide period_s_ = 0, time_s_ = 0, change_s_ = 0;
  bool nominal_now_ = false, last_ = false;
  bool wished_ = false;  // last_wish_ is that of the step before, by the same wish
  PerMass<Real> last_wish_{}, last_command_{};
  bool held_ = false;
  bool near_edge_ = false;
  HeldBall held_ball_;
  Real most_use_ = 0;
  Breach breach_;
  Real use_before_ = 0, use_at_ = 0;  // f_s / (friction N) at the last two steps of a held ball
};

}  // namespace ballast::firmware
