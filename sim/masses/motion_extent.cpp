#include "sim/masses/motion_extent.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace ballast::sim {
namespace {

// p(s) = position + velocity s + acceleration s^2/2 + jerk s^3/6.
struct Start {
  double position, velocity, acceleration, jerk;

  [[nodiscard]] double position_at(double s) const {
    return position + s * (velocity + s * (acceleration / 2 + s * jerk / 6));
  }
  [[nodiscard]] double velocity_at(double s) const { return velocity + s * (acceleration + s * jerk / 2); }
};

// The places where the velocity is zero; NaN or infinite if there are none. This form does not cancel.
std::array<double, 2> turning_points(const Start& p) {
  const double discriminant = p.acceleration * p.acceleration - 2 * p.jerk * p.velocity;
  const double q = -(p.acceleration + std::copysign(std::sqrt(discriminant), p.acceleration)) / 2;
  return {2 * q / p.jerk, p.velocity / q};
}

// Calls visit(piece, start, time at which the piece begins, its duration) for each piece and for the constant velocity
// after them.
template <class Visit>
void for_each_piece(const Mass& mass, Visit visit) {
  Start p{mass.initial_position, mass.initial_velocity, 0, 0};
  double time = 0;
  std::size_t piece = 0;
  for (const MotionPiece& m : mass.motion) {
    p.acceleration = m.acceleration_start;
    p.jerk = (m.acceleration_end - m.acceleration_start) / m.duration_s;
    visit(piece++, p, time, m.duration_s);
    // The end accelerations, not the jerk, determine the next start, so that exact zeros stay zero.
    p.position += m.duration_s * (p.velocity + m.duration_s * (2 * m.acceleration_start + m.acceleration_end) / 6);
    p.velocity += m.duration_s * (m.acceleration_start + m.acceleration_end) / 2;
    time += m.duration_s;
  }
  p.acceleration = p.jerk = 0;
  visit(piece, p, time, std::numeric_limits<double>::infinity());
}

}  // namespace

PositionExtent position_extent(const Mass& mass, double duration_s) {
  const Extreme start{mass.initial_position, 0, 0};
  PositionExtent extent{start, start};
  for_each_piece(mass, [&](std::size_t piece, const Start& p, double begin_s, double length_s) {
    const double end = std::min(length_s, duration_s - begin_s);
    const auto consider = [&](double s) {
      const Extreme here{p.position_at(s), begin_s + s, piece};
      // An overflow's NaN or infinity is taken over and stays, so that the caller notices it.
      const auto beyond = [&](bool within, const Extreme& known) { return !within && std::isfinite(known.position); };
      if (beyond(here.position >= extent.least.position, extent.least)) extent.least = here;
      if (beyond(here.position <= extent.greatest.position, extent.greatest)) extent.greatest = here;
    };
    if (end <= 0) return;
    for (const double s : turning_points(p)) {
      if (s > 0 && s < end) consider(s);
    }
    consider(end);
  });
  return extent;
}

SpeedExtent speed_extent(const Mass& mass) {
  SpeedExtent extent;
  extent.greatest_speed = std::abs(mass.initial_velocity);
  for_each_piece(mass, [&](std::size_t piece, const Start& p, double, double length_s) {
    if (piece == mass.motion.size()) return;  // the last piece ends with this speed
    const MotionPiece& m = mass.motion[piece];
    const auto consider = [&](double speed) {
      if (speed <= extent.greatest_speed || !std::isfinite(extent.greatest_speed)) return;
      extent.greatest_speed = speed;
      extent.fastest_piece = piece;
    };
    const double vertex = -p.acceleration / p.jerk;
    if (vertex > 0 && vertex < length_s) consider(std::abs(p.velocity_at(vertex)));
    consider(std::abs(p.velocity + length_s * (m.acceleration_start + m.acceleration_end) / 2));
    const double acceleration = std::max(std::abs(m.acceleration_start), std::abs(m.acceleration_end));
    if (acceleration > extent.greatest_acceleration) {
      extent.greatest_acceleration = acceleration;
      extent.hardest_piece = piece;
    }
    if (std::abs(p.jerk) > extent.greatest_jerk) {
      extent.greatest_jerk = std::abs(p.jerk);
      extent.jerkiest_piece = piece;
    }
  });
  return extent;
}

}  // namespace ballast::sim
