#include "sim/motion.h"

#include <cmath>
#include <limits>

namespace ballast::sim {

PrescribedMotion::PrescribedMotion(const Mass& mass) : trajectory_(mass.trajectory) {
  if (!trajectory_.times_s.empty()) {
    pieces_.push_back({0, 0, 1, 0, 0});
    return;
  }
  double start = 0, position = mass.initial_position, velocity = mass.initial_velocity;
  for (const MotionPiece& piece : mass.motion) {
    const double h = piece.duration_s;
    const double a0 = piece.acceleration_start, a1 = piece.acceleration_end;
    pieces_.push_back({start, position, velocity, a0, (a1 - a0) / h});
    position += h * velocity + h * h * (2 * a0 + a1) / 6;
    velocity += h * (a0 + a1) / 2;
    start += h;
  }
  pieces_.push_back({start, position, velocity, 0, 0});
}

PrescribedMotion::Point PrescribedMotion::at(std::size_t piece, double time_s) const {
  const Piece& p = pieces_[trajectory_.times_s.empty() ? piece : 0];
  const double s = time_s - p.start_s;
  return {p.position + s * (p.velocity + s * (p.acceleration / 2 + s * p.jerk / 6)),
          p.velocity + s * (p.acceleration + s * p.jerk / 2), p.acceleration + s * p.jerk};
}

double PrescribedMotion::end_s(std::size_t piece) const {
  const auto& times = trajectory_.times_s;
  if (trajectory_.periodic) {
    const std::size_t in_table = times.size() - 1;
    const double period_s = times.back() - times.front();
    // The table that begins last at or before t = 0 is the first.
    const double first_s = times.front() - period_s * std::ceil(times.front() / period_s);
    return first_s + static_cast<double>(piece / in_table) * period_s + (times[piece % in_table + 1] - times.front());
  }
  if (!times.empty()) return piece + 1 < times.size() ? times[piece + 1] : std::numeric_limits<double>::infinity();
  return piece + 1 < pieces_.size() ? pieces_[piece + 1].start_s : std::numeric_limits<double>::infinity();
}

}  // namespace ballast::sim
