// When a motion given as polynomials crosses the middles between microstep positions, in long double and without regard
// to control ticks: the reference that step pulses are held against. Shares nothing with firmware/motion.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace ballast::stepcheck {

// As a scenario gives it: theta'' goes linearly from the first to the second value; after the last piece it is 0.
struct Piece {
  double duration_s, acceleration_start, acceleration_end;
};

struct Motion {
  double position = 0;  // rail unit, at t = 0
  double velocity = 0;
  std::vector<Piece> pieces;
  long double microsteps_per_unit = 1;  // != 0; sign = wiring
  long double from_zero = 0;            // rail units of `position` from where the count of microsteps is 0
};

// A motion known at instants only, with a jerk of at most max_jerk between them; after the last one at constant
// velocity. The cubic through positions and velocities at both ends of an interval of length T is within max_jerk T^3 /
// 24 of it: their difference is 0 with its slope at both ends, and its third derivative at most 2 max_jerk, since the
// cubic's is a mean of the motion's; so at a distance s from the nearer end it is at most max_jerk s^3 / 3.
struct SampledMotion {
  std::vector<double> position, velocity;  // rail unit, per s; at 0, period, 2 period, ..; at least one
  double period_s = 0;
  double max_jerk = 0;
  double zero = 0;  // where the count of microsteps is 0
  long double microsteps_per_unit = 1;
};

// The motion in microsteps from its start.
class MotionInSteps {
 public:
  explicit MotionInSteps(const Motion& motion);
  explicit MotionInSteps(const SampledMotion& motion);
  [[nodiscard]] long double at(long double time_s) const;
  // Microsteps by which the doubles of a firmware may be off, from the size of the numbers; and of a sampled motion
  // what is not known between its samples.
  [[nodiscard]] long double rounding(long double steps) const;

  struct Part {
    long double start_s, x, v, a, j;
    [[nodiscard]] long double at(long double s) const { return x + s * (v + s * (a / 2 + s * j / 6)); }
    [[nodiscard]] long double velocity(long double s) const { return v + s * (a + s * j / 2); }
  };
  [[nodiscard]] const std::vector<Part>& parts() const { return parts_; }

 private:
  std::vector<Part> parts_;      // the last one has no end
  long double start_steps_ = 0;  // of the initial position from the rail's zero
  long double unknown_steps_ = 0;
};

struct Crossing {
  long double time_s;
  int direction;        // +1 or -1
  std::int64_t before;  // count before it; the level crossed is before + direction / 2
};

// All crossings in the order of time, one after the other.
class Crossings {
 public:
  Crossings(const MotionInSteps& motion, std::int64_t count);
  // False: none before until_s, nor before any earlier until_s; then asking for a later one goes on from there.
  bool next(long double until_s, Crossing& crossing);

 private:
  bool open_span();

  const MotionInSteps& motion_;
  std::size_t part_ = 0;
  std::vector<long double> ends_s_;  // of the part's monotone spans, from the part's start
  std::size_t span_ = 0;
  long double begin_s_ = 0, end_s_ = 0;  // of the span, from the part's start
  long double until_s_ = 0;
  std::int64_t count_;
};

}  // namespace ballast::stepcheck
