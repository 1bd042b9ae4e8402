#include "tests/stepcheck/drives.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace ballast::stepcheck {

namespace {

class Draw {
 public:
  explicit Draw(std::mt19937_64& random) : random_(random) {}
  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  double log_between(double low, double high) { return std::exp(between(std::log(low), std::log(high))); }
  double sign() { return random_() % 2 == 0 ? 1 : -1; }
  template <std::size_t n>
  double one_of(const double (&values)[n]) {
    return values[random_() % n];
  }
  std::uint64_t below(std::uint64_t n) { return random_() % n; }

 private:
  std::mt19937_64& random_;
};

// From one velocity to another in `duration`: acceleration up, constant, down, so that the velocity is monotone.
void add_s_curve(std::vector<Piece>& pieces, double from, double to, double duration, double ramp_part) {
  const double ramp = duration * ramp_part / 2, flat = duration - 2 * ramp;
  const double a = (to - from) / (flat + ramp);
  pieces.push_back({ramp, 0, a});
  pieces.push_back({flat, a, a});
  pieces.push_back({ramp, a, 0});
}

}  // namespace

const char* to_string(Shape shape) {
  switch (shape) {
    case Shape::kSCurves:
      return "S-curves";
    case Shape::kAtTheLimit:
      return "at the limit";
    case Shape::kCreep:
      return "creep";
    case Shape::kQuiver:
      return "quiver";
  }
  return "";
}

Drive random_drive(Shape shape, std::mt19937_64& random) {
  Draw draw(random);
  Drive d;
  d.timer_frequency_hz = draw.one_of({1e6, 1e7, 1e8, 84e6, 16e6});
  d.control_period_s = draw.one_of({1e-3, 1e-3, 1e-4, 2e-3, 1.0 / 3000, 1e-2, 1e-5, 0.1});
  const double most_hz = std::min(60 / d.control_period_s, d.timer_frequency_hz / 4);
  d.max_step_rate_hz = draw.below(2) == 0 ? most_hz : draw.log_between(most_hz / 50, most_hz);
  d.direction_setup_s = draw.one_of({0.0, 2e-8, 2e-7, 2e-6, 2e-5});
  Motion& m = d.motion;
  m.microsteps_per_unit = draw.sign() * draw.log_between(20, 1e5);
  m.position = draw.below(3) == 0 ? 0 : draw.between(-10, 10);
  const double top = static_cast<double>(d.max_step_rate_hz / std::fabs(m.microsteps_per_unit)) * (1 - 1e-12);
  const double step = static_cast<double>(1 / std::fabs(m.microsteps_per_unit));
  const double t = d.control_period_s;
  double v = 0;
  switch (shape) {
    case Shape::kSCurves:
      m.velocity = v = draw.below(2) == 0 ? 0 : top * draw.between(-1, 1);
      for (int i = 0; i < 12; ++i) {
        const double to = draw.below(5) == 0 ? 0 : top * draw.sign() * draw.log_between(1e-3, 1);
        add_s_curve(m.pieces, v, to, t * (draw.below(4) == 0 ? draw.between(0.05, 2) : draw.between(2, 40)),
                    draw.between(0.05, 0.95));
        v = to;
        if (draw.below(3) == 0) m.pieces.push_back({t * draw.between(0.1, 10), 0, 0});
      }
      break;
    case Shape::kAtTheLimit: {
      v = m.velocity = top * draw.sign();
      for (int i = 0; i < 3; ++i) {
        m.pieces.push_back({t * draw.between(1, 15), 0, 0});
        add_s_curve(m.pieces, v, -v, t * draw.between(2, 20), 0.5);
        v = -v;
      }
      break;
    }
    case Shape::kCreep:
      v = m.velocity = draw.sign() * std::min(top, step * draw.log_between(1e-2, 10) / t / 100);
      for (int i = 0; i < 8; ++i) {
        const double to = draw.sign() * std::min(top, step * draw.log_between(1e-2, 10) / t / 100);
        add_s_curve(m.pieces, v, to, t * draw.between(1, 60), 0.5);
        v = to;
      }
      break;
    case Shape::kQuiver: {
      // x goes to and fro by v d / 4 and more slowly drifts, so that turns pass the levels closely.
      const double reach = step * draw.log_between(1e-6, 3);
      const double slowest = 4 * reach / top;
      const double duration = std::max(slowest, t * draw.log_between(0.02, 5));
      v = m.velocity = reach / duration;
      for (int i = 0; i < 42; ++i) {
        const double to = std::clamp(-v * draw.between(0.9, 1.1), -top, top);
        const double a = (to - v) / duration;
        m.pieces.push_back({duration, a, a});
        v = to;
      }
      break;
    }
  }
  return d;
}

Generator::Generator(const Drive& drive)
    : drive_(drive), timing_{drive.timer_frequency_hz, drive.control_period_s, drive.direction_setup_s} {
  std::vector<firmware::ProfilePiece> pieces;
  for (const Piece& p : drive.motion.pieces) pieces.push_back({p.duration_s, p.acceleration_start, p.acceleration_end});
  if (!profile_.set(drive.motion.position, drive.motion.velocity, pieces.data(), static_cast<int>(pieces.size()))) {
    throw std::runtime_error("no profile");
  }
}

firmware::StepError Generator::tick() {
  ++tick_;
  command_.tick = tick_;
  command_.steps = {};
  command_.burst_count = 0;
  bursts_.clear();
  const firmware::StepError error = firmware::generate_steps(
      profile_, static_cast<double>(tick_) * drive_.control_period_s, drive_.motion.position,
      static_cast<double>(drive_.motion.microsteps_per_unit), drive_.max_step_rate_hz, timing_, 0, command_, &trouble_);
  for (int b = 0; b < command_.burst_count; ++b) {
    const firmware::StepBurst& burst = command_.bursts[static_cast<std::size_t>(b)];
    bursts_.push_back({burst.direction, burst.count, burst.first_ticks, burst.interval_ticks, burst.add_ticks});
  }
  return error;
}

}  // namespace ballast::stepcheck
