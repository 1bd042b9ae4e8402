#include "firmware/motion/step_generator.h"

#include <algorithm>
#include <cmath>

#include "firmware/motion/burst.h"
#include "firmware/motion/crossing.h"

namespace ballast::firmware {

namespace {

constexpr Real kRateSlack = 1e-9;  // relative: a profile exactly at the motor's rate is not too fast by rounding

// The crossings of one control tick, in order, with the count they lead to.
class Pulses {
 public:
  Pulses(std::int64_t count, Real shortest_s, Real max_rate_hz, Real tolerance_s)
      : count_(count), shortest_s_(shortest_s), max_rate_hz_(max_rate_hz), tolerance_s_(tolerance_s) {}

  // All steps of a span that ends at x_end. False: too many.
  bool follow(const StepCubic& cubic, Real begin_s, Real end_s, Real cubic_start_s) {
    const Real x_end = cubic.at(end_s);
    const Real ahead = x_end - static_cast<Real>(count_);
    if (std::fabs(ahead) <= 0.5) return true;
    if (!(std::fabs(ahead) <= kMaxStepsPerTick + 1.0)) return false;  // also NaN; and keeps the conversion in range
    const Real direction = ahead > 0 ? 1 : -1;
    // Strictly beyond the level, so that half-way keeps the count.
    const int steps = static_cast<int>(std::ceil(std::fabs(ahead) - 0.5));
    for (int j = 0; j < steps; ++j) {
      const Real level = static_cast<Real>(count_) + direction / 2;
      const Real w = crossing_time(cubic, level, begin_s, end_s, tolerance_s_);
      const bool fast = std::fabs(cubic.velocity_at(w)) > max_rate_hz_ * (1 + kRateSlack);
      if (!add(cubic_start_s + w, direction > 0 ? 1 : -1, fast)) return false;
    }
    return true;
  }

  [[nodiscard]] int size() const { return size_; }
  [[nodiscard]] std::int64_t count() const { return count_; }
  [[nodiscard]] Real time_s(int i) const { return time_s_[static_cast<std::size_t>(i)]; }
  [[nodiscard]] std::int8_t direction(int i) const { return direction_[static_cast<std::size_t>(i)]; }

  [[nodiscard]] bool too_fast() const {
    const Real shortest = (1 - kRateSlack) / max_rate_hz_ - 2 * tolerance_s_;
    for (int i = 0; i < size_; ++i) {
      if (fast_[static_cast<std::size_t>(i)]) return true;
      if (i > 0 && time_s(i) - time_s(i - 1) < shortest) return true;
    }
    return false;
  }

 private:
  bool add(Real time_s, int direction, bool fast) {
    count_ += direction;
    if (++found_ > 2 * kMaxStepsPerTick) return false;  // touches count too: the work stays bounded
    if (size_ > 0) {
      const auto last = static_cast<std::size_t>(size_ - 1);
      if (direction_[last] != direction && time_s - time_s_[last] < shortest_s_) {
        --size_;  // there and back: a touch
        return true;
      }
    }
    if (size_ == kMaxStepsPerTick) return false;
    const auto k = static_cast<std::size_t>(size_++);
    time_s_[k] = time_s;
    direction_[k] = static_cast<std::int8_t>(direction);
    fast_[k] = fast;
    return true;
  }

  std::int64_t count_;
  Real shortest_s_;
  Real max_rate_hz_;
  Real tolerance_s_;  // of a crossing's time
  int found_ = 0;
  int size_ = 0;
  // The first size_ entries are set.
  std::array<Real, kMaxStepsPerTick> time_s_;
  std::array<std::int8_t, kMaxStepsPerTick> direction_;
  std::array<bool, kMaxStepsPerTick> fast_;
};

}  // namespace

StepError generate_steps(const Profile& profile, Real t0_s, Real position_zero, Real steps_per_unit,
                         Real max_step_rate_hz, const StepTiming& timing, int motor, StepCommand& out) {
  const auto m = static_cast<std::size_t>(motor);
  const Real period = timing.control_period_s;
  const Real tolerance_s = 1e-3 / timing.timer_frequency_hz;  // small beside the rounding to timer ticks
  const Real shortest_s =
      std::fmax(std::fmax(0.5e-6, 1 / timing.timer_frequency_hz), (1 - kRateSlack) / max_step_rate_hz);
  Pulses pulses(out.position_steps[m], shortest_s, max_step_rate_hz, tolerance_s);

  // Each piece is expanded about the later of its own start and t0, so that times are small numbers and resolution does
  // not fade as the run goes on.
  const Real begin = std::fmax(t0_s, 0.0);
  const Profile::Location here = profile.locate(begin);
  Real start = begin - t0_s;  // from the tick's start
  for (int i = here.index; i <= profile.piece_count() && start < period; ++i) {
    const Cubic& c = profile.cubic(i);
    const Real s = i == here.index ? here.offset_s : 0;
    const StepCubic local{steps_per_unit * ((c.position - position_zero) +
                                            s * (c.velocity + s * (c.acceleration / 2 + s * (c.jerk / 6)))),
                          steps_per_unit * (c.velocity + s * (c.acceleration + s * (c.jerk / 2))),
                          steps_per_unit * (c.acceleration + s * c.jerk), steps_per_unit * c.jerk};
    const Real end = i < profile.piece_count() ? std::fmin(period, profile.cubic_start_s(i + 1) - t0_s) : period;
    if (!(end > start)) continue;  // a piece shorter than the resolution of its start time
    const MonotoneSpans spans = monotone_spans(local, end - start);
    Real from = 0;
    for (int k = 0; k < spans.count; ++k) {
      const Real to = spans.end_s[static_cast<std::size_t>(k)];
      if (!pulses.follow(local, from, to, start)) return StepError::kTooManySteps;
      from = to;
    }
    start = end;
  }
  if (pulses.size() == 0) return StepError::kNone;  // the usual tick of a slow mass
  if (pulses.too_fast()) return StepError::kTooFast;

  std::array<PulseWindow, kMaxStepsPerTick> storage{};
  const auto size = static_cast<std::size_t>(pulses.size());
  for (std::size_t j = 0; j < size; ++j) {
    storage[j].exact_ticks = pulses.time_s(static_cast<int>(j)) * timing.timer_frequency_hz;
    storage[j].direction = pulses.direction(static_cast<int>(j));
  }
  const std::span<PulseWindow> windows(storage.data(), size);
  if (!make_windows(windows, timing)) return StepError::kTooFast;

  std::array<StepBurst, kMaxBursts> bursts{};
  int burst_count = 0;
  for (std::size_t done = 0; done < size;) {
    if (out.burst_count + burst_count == kMaxBursts) return StepError::kTooManyBursts;
    StepBurst burst = longest_burst(windows.subspan(done));
    burst.motor = static_cast<std::uint8_t>(motor);
    done += static_cast<std::size_t>(burst.count);
    bursts[static_cast<std::size_t>(burst_count++)] = burst;
  }

  for (int k = 0; k < burst_count; ++k) {
    out.bursts[static_cast<std::size_t>(out.burst_count++)] = bursts[static_cast<std::size_t>(k)];
  }
  out.steps[m] += static_cast<std::int32_t>(pulses.count() - out.position_steps[m]);
  out.position_steps[m] = pulses.count();
  return StepError::kNone;
}

}  // namespace ballast::firmware
