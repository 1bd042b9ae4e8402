#include "tools/stepcheck/step_check.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace ballast::stepcheck {

namespace {

// Rounding, in timer ticks, of pulses that are just as close as the step rate allows.
constexpr long double kSpacingSlackTicks = 0.02L;
// Crossings this close to a border between ticks, in timer ticks, may count on its other side.
constexpr long double kBorderTicks = 5e-3L;
// Relative rounding of touches that are just as long as the rule allows.
constexpr long double kTouchSlack = 1e-6L;
constexpr int kMostBurstPulses = 1 << 20;

struct KindText {
  const char *name, *sentence, *unit;
};

// By the order of Kind.
constexpr KindText kTexts[] = {
    {"malformed", "a burst without pulses or direction, or whose times do not increase:", "timer ticks"},
    {"outside_tick", "a pulse outside its control tick:", "us"},
    {"spacing", "two pulses closer than the step rate allows:", "us"},
    {"set_up", "two opposite pulses closer than the set-up time:", "us"},
    {"count", "steps or position_steps are not what the pulses add up to:", "microsteps"},
    {"off_time", "a pulse too far from its crossing:", "us"},
    {"lost", "a crossing without its pulse; to the next pulse or the tick's end", "us"},
    {"extra", "a pulse without its crossing; to the next crossing", "us"},
    {"drift", "the count at the tick's end is off the motion by", "microsteps"},
};
static_assert(std::size(kTexts) == static_cast<std::size_t>(Kind::kDrift) + 1);

const KindText& text_of(Kind kind) { return kTexts[static_cast<std::size_t>(kind)]; }

}  // namespace

const char* to_string(Kind kind) { return text_of(kind).name; }

std::string Violation::text() const {
  const auto& [name, sentence, unit] = text_of(kind);
  return fmt::format("tick {}, {:.3f} timer ticks: {} {:.6g} {} (allowed {:.6g})", tick, timer_ticks, sentence, value,
                     unit, limit);
}

MotorCheck::MotorCheck(const Drive& drive)
    : motion_(drive.motion),
      frequency_hz_(drive.timer_frequency_hz),
      period_s_(drive.control_period_s),
      period_ticks_(period_s_ * frequency_hz_),
      spacing_ticks_(frequency_hz_ / drive.max_step_rate_hz),
      setup_ticks_(drive.direction_setup_s * frequency_hz_),
      tolerance_s_(std::max(1 / frequency_hz_, 0.5e-6L)),
      touch_s_(std::max({tolerance_s_, spacing_ticks_ / frequency_hz_, (setup_ticks_ + 1.01L) / frequency_hz_})) {
  // Decimal periods and frequencies make whole numbers of ticks, though their doubles do not quite.
  if (std::fabs(period_ticks_ - std::round(period_ticks_)) <= 1e-6L) period_ticks_ = std::round(period_ticks_);
  statistics_.tolerance_us = static_cast<double>(1e6L * tolerance_s_);
  crossings_.emplace(motion_, 0);
}

void MotorCheck::follow(std::int64_t tick, const MotionInSteps& motion) {
  start_tick_ = tick;
  motion_ = motion;
  crossings_.emplace(motion_, position_steps_);
  due_.clear();
  touch_until_s_ = -1;
  on_motion_ = true;
}

bool MotorCheck::expect(std::size_t count, long double until_s) {
  Crossing c{};
  while (due_.size() < count && crossings_->next(until_s, c)) due_.push_back(c);
  return due_.size() >= count;
}

// Removes the first crossing there and back from those due. False: there is none up to the time of a touch after now_s.
bool MotorCheck::touch_ahead(long double now_s) {
  const long double touch = touch_s_ * (1 + kTouchSlack) + 2e-3L / frequency_hz_;
  for (std::size_t i = 0; expect(i + 2, now_s + touch); ++i) {
    if (due_[i].direction == due_[i + 1].direction) continue;
    if (due_[i + 1].time_s - due_[i].time_s > touch) continue;
    touch_until_s_ = std::max(touch_until_s_, due_[i + 1].time_s);
    due_.erase(due_.begin() + static_cast<std::ptrdiff_t>(i), due_.begin() + static_cast<std::ptrdiff_t>(i) + 2);
    statistics_.touches += 2;
    return true;
  }
  return false;
}

std::optional<Violation> MotorCheck::distances(std::int64_t tick, std::int64_t timer_tick, int direction) {
  std::optional<Violation> found;
  if (has_last_) {
    const long double gap = static_cast<long double>(tick - last_tick_) * period_ticks_ +
                            static_cast<long double>(timer_tick - last_timer_tick_);
    const auto us = [this](long double ticks) { return static_cast<double>(1e6L * ticks / frequency_hz_); };
    const auto at = static_cast<double>(timer_tick);
    double& least = direction == last_direction_ ? statistics_.least_spacing_us : statistics_.least_turn_us;
    if (least == 0 || us(gap) < least) least = us(gap);
    if (gap <= 0 || gap < spacing_ticks_ - 1 - kSpacingSlackTicks) {
      found = Violation{Kind::kSpacing, tick, at, us(gap), us(spacing_ticks_)};
    } else if (direction != last_direction_ && gap < setup_ticks_ - 1e-6L) {
      found = Violation{Kind::kSetUp, tick, at, us(gap), us(setup_ticks_)};
    }
  }
  has_last_ = true;
  last_tick_ = tick;
  last_timer_tick_ = timer_tick;
  last_direction_ = direction;
  return found;
}

std::optional<Violation> MotorCheck::match(std::int64_t tick, std::int64_t timer_tick, int direction) {
  const long double t = time_s(tick, static_cast<long double>(timer_tick));
  const auto at = static_cast<double>(timer_tick);
  const auto us = [](long double seconds) { return static_cast<double>(1e6L * seconds); };
  const long double tolerance = tolerance_s_ + 2e-3L / frequency_hz_;  // and the error of the crossing's own time
  for (bool touches_left = true;;) {
    if (!expect(1, t + tolerance_s_ + touch_s_)) {
      return Violation{Kind::kExtra, tick, at, us(touch_s_), us(tolerance_s_)};
    }
    const Crossing& c = due_.front();
    if (c.direction == direction) {
      long double error = t - c.time_s;
      bool good = std::fabs(error) <= tolerance;
      if (!good && !touches_left) {
        // A creeping mass: where rounding blurs its crossing by more than that, the position decides.
        const long double level = static_cast<long double>(c.before) + 0.5L * direction;
        const long double slack = motion_.rounding(level);
        good = direction * (motion_.at(t - tolerance_s_) - level) <= slack &&
               direction * (motion_.at(t + tolerance_s_) - level) >= -slack;
        error = std::clamp(error, -tolerance_s_, tolerance_s_);
      }
      if (good) {
        ++statistics_.checked_steps;
        const double error_us = us(error);
        statistics_.max_error_us = std::max(statistics_.max_error_us, std::fabs(error_us));
        statistics_.sum_square_us2 += error_us * error_us;
        const int bin = static_cast<int>(std::floor((error_us / statistics_.tolerance_us + 1) / 2 * kBins));
        ++statistics_.histogram[static_cast<std::size_t>(std::clamp(bin, 0, kBins - 1))];
        due_.pop_front();
        return std::nullopt;
      }
    }
    if (touches_left) {
      touches_left = touch_ahead(t);
      continue;
    }
    const Crossing& first = due_.front();
    const long double error = t - first.time_s;
    const bool next_fits =
        expect(2, t + tolerance_s_) && due_[1].direction == direction && std::fabs(t - due_[1].time_s) <= tolerance;
    Kind kind = Kind::kOffTime;
    if (next_fits || (error > 0 && (first.direction != direction || error > 20 * tolerance_s_))) kind = Kind::kLost;
    if (error < 0 && (first.direction != direction || error < -20 * tolerance_s_)) kind = Kind::kExtra;
    return Violation{kind, tick, at, us(std::fabs(error)), us(tolerance_s_)};
  }
}

std::optional<Violation> MotorCheck::pulse(std::int64_t tick, std::int64_t timer_tick, int direction) {
  if (timer_tick < 0 || static_cast<long double>(timer_tick) >= period_ticks_) {
    return Violation{Kind::kOutsideTick, tick, static_cast<double>(timer_tick),
                     static_cast<double>(1e6L * static_cast<long double>(timer_tick) / frequency_hz_),
                     static_cast<double>(1e6L * period_s_)};
  }
  if (auto violation = distances(tick, timer_tick, direction)) return violation;
  if (on_motion_) return match(tick, timer_tick, direction);
  ++statistics_.structural_steps;
  return std::nullopt;
}

std::optional<Violation> MotorCheck::tick(std::int64_t tick, std::span<const Burst> bursts, std::int64_t steps,
                                          std::int64_t position_steps) {
  if (failed_) return std::nullopt;
  const auto fail = [this](const Violation& violation) {
    failed_ = true;
    return std::optional(violation);
  };
  std::int64_t sum = 0;
  for (const Burst& burst : bursts) {
    const bool turned = burst.direction != 1 && burst.direction != -1;
    if (turned || burst.count < 1 || burst.count > kMostBurstPulses) {
      return fail({Kind::kMalformed, tick, static_cast<double>(burst.first), static_cast<double>(burst.count), 1});
    }
    for (std::int64_t j = 0; j < burst.count; ++j) {
      const std::int64_t now = burst.first + j * burst.interval + burst.add * (j * (j - 1) / 2);
      const std::int64_t to_next = burst.interval + j * burst.add;
      if (j + 1 < burst.count && to_next < 1) {
        return fail({Kind::kMalformed, tick, static_cast<double>(now), static_cast<double>(to_next), 1});
      }
      if (const auto violation = pulse(tick, now, burst.direction)) return fail(*violation);
      sum += burst.direction;
    }
  }
  const std::int64_t before = position_steps_;
  position_steps_ += sum;
  if (steps != sum || position_steps != position_steps_) {
    const std::int64_t off = steps != sum ? steps - sum : position_steps - before - sum;
    return fail({Kind::kCount, tick, 0, static_cast<double>(off), 0});
  }
  if (!on_motion_) return std::nullopt;

  // A level crossed in this tick has its pulse by now, belongs to a touch, or lies on the border.
  const long double end_s = time_s(tick + 1, 0);
  const long double border_s = kBorderTicks / frequency_hz_;
  while (expect(1, end_s) && due_.front().time_s < end_s - border_s) {
    const Crossing& c = due_.front();
    const long double level = static_cast<long double>(c.before) + 0.5L * c.direction;
    if (c.direction * (motion_.at(end_s) - level) <= motion_.rounding(level) &&
        c.direction * (motion_.at(end_s) - level) >= 0) {
      break;  // hardly beyond the level: rounding may put the crossing after the border
    }
    const long double crossed_s = c.time_s;
    if (!touch_ahead(end_s)) {
      const auto at = static_cast<double>((crossed_s - time_s(tick, 0)) * frequency_hz_);
      return fail({Kind::kLost, tick, at, static_cast<double>(1e6L * (end_s - crossed_s)), statistics_.tolerance_us});
    }
  }
  const long double x = motion_.at(end_s);
  const long double off = std::fabs(x - static_cast<long double>(position_steps_));
  const long double moved = std::fabs(x - motion_.at(end_s - border_s));
  if (touch_until_s_ < end_s - border_s && off > 0.5L + motion_.rounding(x) + moved) {
    return fail({Kind::kDrift, tick, static_cast<double>(period_ticks_), static_cast<double>(off), 0.5});
  }
  return std::nullopt;
}

}  // namespace ballast::stepcheck
