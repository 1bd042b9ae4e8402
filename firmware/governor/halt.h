// Brings the ball to rest: accelerations of the masses that take the rolling ball's speed away, and how far it rolls.
//
// The masses carry the centre of mass behind the contact point, so that weight brakes the ball, and back under the
// centre as it slows down. Masses that are too slow to stay behind a fast ball yield to what pulls at them, as dampers
// would: that takes energy out of it. The wish goes through the governor as any other, so the halt keeps the cone.
//
// Invariants: fixed size, no heap. The same bits on every processor.
//
// Source: our derivation, tools/docs/governor.md, "Halt".
#pragma once

#include "firmware/governor/rollout.h"

namespace ballast::firmware {

// The ball is at rest where it is slower than kRestSpeed sqrt(g r) for kRestTime_s.
inline constexpr Real kRestSpeed = Real(0.01);
inline constexpr Wide kRestTime_s = 1;

struct HaltGains {
  Real braking_s = 0;     // time constant with which the speed falls
  Real offset_radps = 0;  // bandwidth with which the centre of mass follows
  Real damping_s = 0;     // time constant with which the masses come to rest, where that leaves the offset alone
  Real yielding_s = 0;    // a mass that yields goes with this times what would accelerate it, were it free on its rail
  Real following_s = 0;   // time constant with which it takes up that velocity
};

// Multiples of sqrt(r / g), or of 1 s without gravity.
[[nodiscard]] HaltGains halt_gains(const BallParams& ball);

// Within the masses' max_acceleration.
[[nodiscard]] PerMass<Real> halt_wish(const BallParams& ball, const GovernorParams& params, const HaltGains& gains,
                                      const RobotState& state);

// Below this the ball is at rest.
[[nodiscard]] Real rest_speed_mps(const BallParams& ball);

// Speed of the geometric centre.
[[nodiscard]] Real speed_mps(const BallParams& ball, const RobotState& state);

struct HaltPrediction {
  bool complete = false;
  bool rests = false;  // false: not at rest within the horizon
  Real distance_m =
      0;  // along the path, from the halt's beginning to the last tick in which the ball is faster than rest
  Vector2 place_W_m = Vector2::Zero();
  Wide time_s = 0;                                 // between these
  Real speed_before_mps = 0, speed_after_mps = 0;  // where the halt begins, and where the rollout ends
};

// Rolls a halt forward, a few steps per control tick.
class HaltRollout {
 public:
  // From `state` at the start of `tick`: what runs now up to `from_tick`, by the candidate's schedule, and the halt
  // from there.
  void begin(const GovernorParams& params, const RobotState& state, std::int64_t tick, const Schedule& change,
             Wide longest_s);
  // Does steps while their cost so far is below `work`. `law`: as for govern(), with the halt from `from` on.
  template <class Law>
  void advance(const BallParams& ball, const GovernorParams& params, const Law& law, const Bends& in_force, int work) {
    for (int left = work; left > 0 && !result_.complete;) {
      const Vector2 before = rollout_.state().position_W_m;
      rollout_.advance(ball, params, law, in_force, 1);
      left -= kMovingStepWork * rollout_.cost();
      take(ball, before);
    }
  }
  [[nodiscard]] const HaltPrediction& result() const { return result_; }

 private:
  void take(const BallParams& ball, const Vector2& before_W_m);

  // Times after begin()'s tick: at which the halt begins, and up to which it is rolled.
  Rollout rollout_;
  HaltPrediction result_;
  Wide from_s_ = 0, longest_s_ = 0;
  Real path_m_ = 0;
};

}  // namespace ballast::firmware
