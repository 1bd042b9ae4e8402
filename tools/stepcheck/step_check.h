// Replays a controller's step bursts and compares every pulse with the commanded motion. Bursts are integers, the
// motion is long double. No code is shared with the firmware that made the bursts.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>

#include "tools/stepcheck/motion_crossings.h"

namespace ballast::stepcheck {

// As in step_command_t: pulse j of `count` comes first + j interval + add j (j - 1) / 2 timer ticks after its control
// tick's start.
struct Burst {
  int direction;
  std::int64_t count, first, interval, add;
};

struct Drive {
  Motion motion;
  double max_step_rate_hz = 0;
  double direction_setup_s = 0;
  double timer_frequency_hz = 0;
  double control_period_s = 0;
};

enum class Kind {
  kMalformed,    // a burst that is none: no pulses, no direction, times not increasing
  kOutsideTick,  // a pulse not inside its control tick
  kSpacing,      // two pulses closer than the step rate allows
  kSetUp,        // two opposite pulses closer than the driver's set-up time
  kCount,        // `steps` or `position_steps` are not what the pulses add up to
  kOffTime,      // a pulse too far from its crossing
  kLost,         // a crossing without its pulse
  kExtra,        // a pulse without its crossing
  kDrift,        // the count is not the nearest to the motion at the end of a tick
};
const char* to_string(Kind kind);

struct Violation {
  Kind kind;
  std::int64_t tick;
  double timer_ticks;   // the pulse or crossing, from the tick's start
  double value, limit;  // us; kCount and kDrift: microsteps
  [[nodiscard]] std::string text() const;
};

inline constexpr int kBins = 20;

// Pulses minus crossings, over all steps matched.
struct Statistics {
  std::int64_t checked_steps = 0;     // pulses held against a crossing
  std::int64_t structural_steps = 0;  // pulses outside the motion: spacing, set-up and counts only
  std::int64_t touches = 0;           // crossings there and back without pulses, as the rule for touches allows
  double tolerance_us = 0;            // 1 timer tick or 0.5 us
  double max_error_us = 0;
  double sum_square_us2 = 0;
  std::array<std::int64_t, kBins> histogram{};  // of -tolerance..tolerance
  double least_spacing_us = 0;                  // 0: fewer than two pulses
  double least_turn_us = 0;                     // between opposite pulses; 0: none
};

// One motor. What is checked:
// - every pulse within 1 timer tick or 0.5 us of its own crossing, in order, one for one; a crossing there and back
//   within the time of a touch (step rate, set-up time plus a timer tick, or that tolerance) may go without;
// - pulses at least 1 / max_step_rate apart, less a timer tick of rounding; opposite ones by the set-up time in full;
//   from one to the next, whatever tick borders lie between;
// - steps and position_steps are the sum of the pulses; at the end of each tick that is the integer nearest to the
//   motion, unless a touch is under way.
// A crossing closer to a border between ticks than rounding may have its pulse in either tick.
class MotorCheck {
 public:
  explicit MotorCheck(const Drive& drive);
  MotorCheck(const MotorCheck&) = delete;
  MotorCheck& operator=(const MotorCheck&) = delete;

  // Checks ticks in order; tick 0 begins at t = 0 of the drive's motion. Returns the first violation, if any. After
  // one, nothing more is checked.
  std::optional<Violation> tick(std::int64_t tick, std::span<const Burst> bursts, std::int64_t steps,
                                std::int64_t position_steps);
  // The pulses follow another motion from the start of `tick`, the next one. Its t = 0 is there. The count goes on.
  void follow(std::int64_t tick, const MotionInSteps& motion);
  // The pulses follow no motion from now on. Only their structure is checked.
  void leave_motion() { on_motion_ = false; }

  [[nodiscard]] const Statistics& statistics() const { return statistics_; }

 private:
  std::optional<Violation> pulse(std::int64_t tick, std::int64_t timer_tick, int direction);
  std::optional<Violation> distances(std::int64_t tick, std::int64_t timer_tick, int direction);
  std::optional<Violation> match(std::int64_t tick, std::int64_t timer_tick, int direction);
  bool expect(std::size_t count, long double until_s);
  bool touch_ahead(long double now_s);
  // Time since the motion's t = 0.
  [[nodiscard]] long double time_s(std::int64_t tick, long double timer_ticks) const {
    return static_cast<long double>(tick - start_tick_) * period_s_ + timer_ticks / frequency_hz_;
  }

  std::int64_t start_tick_ = 0;
  MotionInSteps motion_;
  std::optional<Crossings> crossings_;
  std::deque<Crossing> due_;  // crossings without their pulse yet
  long double frequency_hz_, period_s_, period_ticks_, spacing_ticks_, setup_ticks_, tolerance_s_, touch_s_;
  long double touch_until_s_ = -1;  // the end of the latest touch without pulses
  bool on_motion_ = true;
  bool failed_ = false;
  std::int64_t position_steps_ = 0;
  bool has_last_ = false;
  std::int64_t last_tick_ = 0, last_timer_tick_ = 0;
  int last_direction_ = 0;
  Statistics statistics_;
};

}  // namespace ballast::stepcheck
