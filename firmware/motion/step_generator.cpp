#include "firmware/motion/step_generator.h"

#include <algorithm>
#include <cmath>

#include "firmware/motion/burst.h"
#include "firmware/motion/crossing.h"
#include "firmware/motion/smooth_run.h"

namespace ballast::firmware {

namespace {

constexpr Wide kRateSlack = 1e-9;  // relative: a profile exactly at the motor's rate is not too fast by rounding

// Microsteps. A reversal that ends less than this above a level counts as back below it. The tick before and the tick
// after a border expand the profile about different times, and their rounding must not make them disagree.
constexpr Wide kReturnSlack = 1e-7;

// A piece of the profile in microsteps, expanded about `s` after its start, the later of its start and the tick's.
// Times stay small numbers, so the resolution does not fall as the run goes on.
StepCubic in_steps(const Cubic& c, Wide s, Wide position_zero, Wide steps_per_unit) {
  return {
      steps_per_unit * ((c.position - position_zero) + s * (c.velocity + s * (c.acceleration / 2 + s * (c.jerk / 6)))),
      steps_per_unit * (c.velocity + s * (c.acceleration + s * (c.jerk / 2))),
      steps_per_unit * (c.acceleration + s * c.jerk), steps_per_unit * c.jerk};
}

// The monotone spans of the profile from t0 on, in order, in microsteps.
class Spans {
 public:
  Spans(const Profile& profile, Wide t0_s, Wide position_zero, Wide steps_per_unit)
      : profile_(profile), t0_s_(t0_s), position_zero_(position_zero), steps_per_unit_(steps_per_unit) {}

  // Calls visit(cubic, begin, end, start) for each span with begin_s <= time from t0 <= end_s; `start` is the cubic's
  // own zero of time. Ends early and returns false where visit() does.
  template <class Visit>
  bool each(Wide begin_s, Wide end_s, Visit visit) const {
    const Profile::Location here = profile_.locate(t0_s_ + begin_s);
    Wide start = begin_s;
    Wide s = here.offset_s;
    for (int i = here.index; i <= profile_.piece_count() && start < end_s; ++i, s = 0) {
      const Wide end = i < profile_.piece_count() ? std::fmin(end_s, profile_.cubic_start_s(i + 1) - t0_s_) : end_s;
      if (!(end > start)) continue;  // a piece shorter than the resolution of its start time
      const StepCubic cubic = in_steps(profile_.cubic(i), s, position_zero_, steps_per_unit_);
      const MonotoneSpans monotone = monotone_spans(cubic, end - start);
      Wide from = 0;
      for (int k = 0; k < monotone.count; ++k) {
        const Wide to = monotone.end_s[static_cast<std::size_t>(k)];
        if (!visit(cubic, from, to, start)) return false;
        from = to;
      }
      start = end;
    }
    return true;
  }

 private:
  const Profile& profile_;
  Wide t0_s_, position_zero_, steps_per_unit_;
};

// The crossings of one control tick in order, and the step count after them.
class Pulses {
 public:
  Pulses(std::int64_t count, const PulseRules& rules, Wide timer_frequency_hz)
      : count_(count),
        touch_ticks_(rules.touch_ticks),
        timer_frequency_hz_(timer_frequency_hz),
        tolerance_s_(1e-3 / timer_frequency_hz) {}  // small beside the rounding to timer ticks

  // Adds all steps of a span. False: too many.
  bool follow(const StepCubic& cubic, Wide begin_s, Wide end_s, Wide cubic_start_s) {
    const Wide x_end = cubic.at(end_s);
    const Wide ahead = x_end - static_cast<Wide>(count_);
    const Wide distance = std::fabs(ahead);
    if (distance <= 0.5) return true;
    if (!(distance <= kMaxStepsPerTick + 1.0)) {  // also NaN; and keeps the conversion in range
      found_ = distance < 1e9 ? static_cast<int>(distance) : 1000000000;
      return false;
    }
    const int direction = ahead > 0 ? 1 : -1;
    // Strictly beyond the level, so that half-way keeps the count.
    int steps = static_cast<int>(distance - 0.5);
    if (static_cast<Wide>(steps) < distance - 0.5) ++steps;

    Wide level = static_cast<Wide>(count_) + 0.5 * direction;
    Wide w = crossing_time(cubic, level, begin_s, end_s, tolerance_s_);
    Wide velocity = cubic.velocity_at(w);
    Wide fastest_hz = std::fabs(velocity);
    if (!add((cubic_start_s + w) * timer_frequency_hz_, direction)) return false;
    // Accelerations are linear, so within twice the span's length of it they are at most 5 times those at its ends.
    const Wide bend = 5 * std::fmax(std::fabs(cubic.acceleration_at(begin_s)), std::fabs(cubic.acceleration_at(end_s)));
    Wide interval = 1 / fastest_hz, growth = 0;
    for (int j = 1; j < steps; ++j) {
      level += direction;
      // The intervals so far give a guess, from which a step of Newton's method suffices unless the profile bends too
      // much.
      Wide next = std::min(w + (interval + growth), end_s);
      if (!crossing_near(cubic, level, bend, tolerance_s_, next, velocity) || !(next >= w && next <= end_s)) {
        next = crossing_time(cubic, level, w, end_s, tolerance_s_);
        velocity = cubic.velocity_at(next);
      }
      growth = j > 1 ? next - w - interval : 0;
      interval = next - w;
      w = next;
      fastest_hz = std::max(fastest_hz, std::fabs(velocity));
      if (!add((cubic_start_s + w) * timer_frequency_hz_, direction)) return false;
    }
    fastest_hz_ = std::max(fastest_hz_, fastest_hz);
    return true;
  }

  // Drops the last pulses that are half of a touch: after this control tick, but within touch_ticks, the profile comes
  // back through their levels.
  void drop_touches(const Spans& spans, Wide period_s) {
    while (size_ > 0) {
      const PulseWindow& last = pulses_[static_cast<std::size_t>(size_ - 1)];
      const Wide until_s = (last.exact_ticks + touch_ticks_) / timer_frequency_hz_;
      if (!(until_s > period_s)) return;
      const int direction = last.direction;
      const Wide level = static_cast<Wide>(count_) - 0.5 * direction;
      const bool stays = spans.each(period_s, until_s, [&](const StepCubic& cubic, Wide, Wide end_s, Wide) {
        return direction * (cubic.at(end_s) - level) > kReturnSlack;
      });
      if (stays) return;
      count_ -= direction;
      --size_;
    }
  }

  [[nodiscard]] std::span<PulseWindow> windows() { return {pulses_.data(), static_cast<std::size_t>(size_)}; }
  [[nodiscard]] std::int64_t count() const { return count_; }
  [[nodiscard]] int found() const { return found_; }
  [[nodiscard]] Wide fastest_hz() const { return fastest_hz_; }

 private:
  bool add(Wide exact_ticks, int direction) {
    count_ += direction;
    ++found_;
    if (found_ > 2 * kMaxStepsPerTick) return false;  // touches count too, so that the work stays bounded
    if (size_ > 0) {
      const PulseWindow& last = pulses_[static_cast<std::size_t>(size_ - 1)];
      if (last.direction != direction && exact_ticks - last.exact_ticks < touch_ticks_) {
        --size_;  // a touch
        return true;
      }
    }
    if (size_ == kMaxStepsPerTick) return false;
    PulseWindow& pulse = pulses_[static_cast<std::size_t>(size_)];
    pulse.exact_ticks = exact_ticks;
    pulse.direction = direction;
    ++size_;
    return true;
  }

  std::int64_t count_;
  Wide touch_ticks_;
  Wide timer_frequency_hz_;
  Wide tolerance_s_;     // of a crossing's time
  int found_ = 0;        // crossings, including touches
  Wide fastest_hz_ = 0;  // the profile's greatest speed at a crossing
  int size_ = 0;
  // The first size_ entries are set.
  std::array<PulseWindow, kMaxStepsPerTick> pulses_;
};

std::int32_t last_pulse_ticks(const StepBurst& burst) {
  return static_cast<std::int32_t>(pulse_ticks(burst, burst.count - 1));
}

// The highest rate between neighbouring pulses, for the report that they cannot keep their distances.
Wide highest_rate_hz(std::span<const PulseWindow> pulses, Wide first_gap_ticks, Wide timer_frequency_hz) {
  Wide least = first_gap_ticks;
  for (std::size_t j = 1; j < pulses.size(); ++j) {
    least = std::fmin(least, pulses[j].exact_ticks - pulses[j - 1].exact_ticks);
  }
  return timer_frequency_hz / std::fmax(least, 1e-3);
}

// The usual case: the tick lies in one piece, and the mass does not turn in it, nor in the time of a touch after it.
// Fills in `run`; its steps may be 0. False: another case, or not surely this one.
bool smooth_tick(const Profile& profile, Wide t0_s, Wide position_zero, Wide steps_per_unit, Wide period_s,
                 Wide touch_s, std::int64_t count, SmoothRun& run) {
  run.start_s = std::max(-t0_s, 0.0);
  const Profile::Location here = profile.locate(t0_s + run.start_s);
  if (here.index < profile.piece_count() && profile.cubic_start_s(here.index + 1) - t0_s < period_s + touch_s) {
    return false;
  }
  run.cubic = in_steps(profile.cubic(here.index), here.offset_s, position_zero, steps_per_unit);
  run.end_s = period_s - run.start_s;
  if (!(run.end_s > 0)) return false;
  const Wide ahead_s = run.end_s + touch_s;
  if (!(run.cubic.acceleration * run.cubic.acceleration_at(ahead_s) >= 0)) return false;
  if (!(run.cubic.velocity * run.cubic.velocity_at(ahead_s) > 0)) {
    const bool stands = run.cubic.velocity == 0 && run.cubic.acceleration == 0 && run.cubic.jerk == 0;
    run.steps = 0;
    return stands && std::fabs(run.cubic.x - static_cast<Wide>(count)) <= 0.5;
  }
  run.direction = run.cubic.velocity > 0 ? 1 : -1;
  run.first_level = static_cast<Wide>(count) + 0.5 * run.direction;
  const Wide before = run.direction * (run.cubic.x - run.first_level);
  if (!(before <= 0 && before >= -1)) return false;  // a step was due earlier
  const Wide beyond = run.direction * (run.cubic.at(run.end_s) - run.first_level);
  if (!(beyond < kMaxStepsPerTick)) return false;
  run.steps = beyond > 0 ? static_cast<int>(beyond) + 1 : 0;
  // Strictly beyond the level, so that half-way keeps the count.
  if (static_cast<Wide>(run.steps - 1) == beyond) --run.steps;
  return run.steps <= kMaxStepsPerTick;
}

// The pulse before a command, which bounds the command's first pulse.
struct Before {
  Wide ago_ticks;  // at the control tick's start
  std::int8_t direction;

  Before(const StepCommand& out, std::size_t m, const PulseRules& rules)
      : ago_ticks(rules.period_ticks + rules.touch_ticks), direction(out.last_pulse[m].direction) {
    // The difference wraps for absurd tick numbers. A pulse from the future does not bound this command.
    const auto ticks = static_cast<std::int64_t>(static_cast<std::uint64_t>(out.tick) -
                                                 static_cast<std::uint64_t>(out.last_pulse[m].tick));
    if (direction != 0 && ticks > 0) {
      ago_ticks = static_cast<Wide>(ticks) * rules.period_ticks - static_cast<Wide>(out.last_pulse[m].timer_ticks);
    } else {
      direction = 0;
    }
  }
  [[nodiscard]] std::int32_t earliest(const PulseRules& rules, int next_direction) const {
    return direction == 0 ? 0 : rules.earliest_after(ago_ticks, direction != next_direction);
  }
};

// Writes bursts that keep every pulse in its window to `bursts` and returns their number; 0: there are too few entries.
int fit_bursts(std::span<PulseWindow> windows, const PulseRules& rules, std::int32_t earliest,
               std::span<StepBurst> bursts) {
  std::size_t count = 0;
  for (std::size_t done = 0; done < windows.size(); ++count) {
    if (count == bursts.size()) return 0;
    bursts[count] = longest_burst(windows.subspan(done), rules, earliest);
    done += static_cast<std::size_t>(bursts[count].count);
    if (done < windows.size()) {
      earliest = last_pulse_ticks(bursts[count]) + windows[done].gap;
      raise_lows(windows.subspan(done), earliest);
    }
  }
  return static_cast<int>(count);
}

// Takes over `burst_count` bursts that were written behind those of `out`.
void commit(StepCommand& out, int motor, int burst_count, std::int64_t count) {
  const auto m = static_cast<std::size_t>(motor);
  for (int k = 0; k < burst_count; ++k) {
    out.bursts[static_cast<std::size_t>(out.burst_count + k)].motor = static_cast<std::uint8_t>(motor);
  }
  out.burst_count += burst_count;
  const StepBurst& burst = out.bursts[static_cast<std::size_t>(out.burst_count - 1)];
  out.last_pulse[m] = {out.tick, last_pulse_ticks(burst), burst.direction};
  out.steps[m] += static_cast<std::int32_t>(count - out.position_steps[m]);
  out.position_steps[m] = count;
}

}  // namespace

StepError generate_steps(const Profile& profile, Wide t0_s, Wide position_zero, Wide steps_per_unit,
                         Wide max_step_rate_hz, const StepTiming& timing, int motor, StepCommand& out,
                         StepTrouble* trouble) {
  const auto m = static_cast<std::size_t>(motor);
  const auto refuse = [trouble](StepError error, Wide value, Wide limit) {
    if (trouble != nullptr) *trouble = {error, value, limit};
    return error;
  };
  const PulseRules rules(timing, max_step_rate_hz);
  const Before before(out, m, rules);
  const int most_bursts = std::min(kMaxBursts - out.burst_count, timing.max_bursts);
  const std::span<StepBurst> free(out.bursts.data() + out.burst_count, static_cast<std::size_t>(most_bursts));

  SmoothRun run;
  if (smooth_tick(profile, t0_s, position_zero, steps_per_unit, timing.control_period_s,
                  rules.touch_ticks / timing.timer_frequency_hz, out.position_steps[m], run)) {
    if (run.steps == 0) return StepError::kNone;  // the usual tick of a slow mass
    run.earliest = before.earliest(rules, run.direction);
    const Wide fastest_hz = std::max(std::fabs(run.cubic.velocity), std::fabs(run.cubic.velocity_at(run.end_s)));
    if (fastest_hz <= max_step_rate_hz * (1 + kRateSlack)) {
      const int bursts = smooth_bursts(run, rules, timing.timer_frequency_hz, free);
      if (bursts > 0) {
        commit(out, motor, bursts, out.position_steps[m] + static_cast<std::int64_t>(run.direction * run.steps));
        return StepError::kNone;
      }
    }
  }

  Pulses pulses(out.position_steps[m], rules, timing.timer_frequency_hz);
  const Spans spans(profile, t0_s, position_zero, steps_per_unit);
  const bool few = spans.each(std::max(-t0_s, 0.0), timing.control_period_s,
                              [&pulses](const StepCubic& cubic, Wide begin_s, Wide end_s, Wide start_s) {
                                return pulses.follow(cubic, begin_s, end_s, start_s);
                              });
  if (!few) return refuse(StepError::kTooManySteps, pulses.found(), kMaxStepsPerTick);
  if (pulses.windows().empty()) return StepError::kNone;
  if (pulses.fastest_hz() > max_step_rate_hz * (1 + kRateSlack)) {
    return refuse(StepError::kTooFast, pulses.fastest_hz(), max_step_rate_hz);
  }
  pulses.drop_touches(spans, timing.control_period_s);
  const std::span<PulseWindow> windows = pulses.windows();
  if (windows.empty()) return StepError::kNone;

  const std::int32_t earliest = before.earliest(rules, windows[0].direction);
  if (!make_windows(windows, rules, earliest)) {
    return refuse(StepError::kTooFast,
                  highest_rate_hz(windows, before.ago_ticks + windows[0].exact_ticks, timing.timer_frequency_hz),
                  max_step_rate_hz);
  }
  const int bursts = fit_bursts(windows, rules, earliest, free);
  if (bursts == 0) return refuse(StepError::kTooManyBursts, most_bursts + 1, most_bursts);
  commit(out, motor, bursts, pulses.count());
  return StepError::kNone;
}

}  // namespace ballast::firmware
