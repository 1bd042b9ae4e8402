#include "sim/motion.h"

#include <limits>

namespace ballast::sim {

PrescribedMotion::PrescribedMotion(const Mass& mass) {
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
  const Piece& p = pieces_[piece];
  const double s = time_s - p.start_s;
  return {p.position + s * (p.velocity + s * (p.acceleration / 2 + s * p.jerk / 6)),
          p.velocity + s * (p.acceleration + s * p.jerk / 2), p.acceleration + s * p.jerk};
}

double PrescribedMotion::end_s(std::size_t piece) const {
  return piece + 1 < pieces_.size() ? pieces_[piece + 1].start_s : std::numeric_limits<double>::infinity();
}

}  // namespace ballast::sim
