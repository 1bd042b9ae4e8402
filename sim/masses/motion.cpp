#include "sim/masses/motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace ballast::sim {

PrescribedMotion::PrescribedMotion(const Mass& mass) : trajectory_(mass.trajectory) {
  if (!trajectory_.times_s.empty()) {
    pieces_.push_back({0, 0, 1, 0, 0});
    return;
  }
  if (mass.rail.shape == firmware::RailShape::kSpline) knot_spacing_ = mass.rail.piece_length_m;
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

void PrescribedMotion::follow(double start_s, const Point& start, double jerk) {
  pieces_.assign(1, {start_s, start.position, start.velocity, start.acceleration, jerk});
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
    const std::size_t tables = piece / in_table;
    return first_s + static_cast<double>(tables) * period_s + (times[piece % in_table + 1] - times.front());
  }
  if (!times.empty()) return piece + 1 < times.size() ? times[piece + 1] : std::numeric_limits<double>::infinity();
  return piece + 1 < pieces_.size() ? pieces_[piece + 1].start_s : std::numeric_limits<double>::infinity();
}

double PrescribedMotion::smooth_until_s(std::size_t piece, double time_s) const {
  const double end = end_s(piece);
  if (knot_spacing_ == 0) return end;
  const Piece& p = pieces_[piece];
  // theta is monotone between the instants at which thetadot = 0; in each such stretch the next knot on its way is
  // known.
  const double discriminant = p.acceleration * p.acceleration - 2 * p.jerk * p.velocity;
  const double q = -(p.acceleration + std::copysign(std::sqrt(discriminant), p.acceleration)) / 2;
  std::array<double, 3> until{p.start_s + 2 * q / p.jerk, p.start_s + p.velocity / q, end};
  if (!(until[0] < until[1])) std::swap(until[0], until[1]);
  double from = time_s;
  for (const double to : until) {
    if (!(to > from) || to > end) continue;
    if (const double knot = next_knot_s(piece, from, to); knot < to) return knot;
    from = to;
  }
  return end;
}

// The stretch is one in which theta is monotone. Returns `to_s` if there is no knot. A knot nearer than 1e-9 of the
// spacing counts as passed.
double PrescribedMotion::next_knot_s(std::size_t piece, double from_s, double to_s) const {
  const double probe_s = std::isfinite(to_s) ? to_s : from_s + 1;  // beyond all pieces the velocity is constant
  const double here = at(piece, from_s).position / knot_spacing_;
  const double there = at(piece, probe_s).position / knot_spacing_;
  const bool up = there > here;
  const double knot = up ? std::floor(here + 1e-9) + 1 : std::ceil(here - 1e-9) - 1;
  const auto passed = [&](double t) {
    const double place = at(piece, t).position / knot_spacing_;
    return up ? place >= knot : place <= knot;
  };
  if (!std::isfinite(to_s)) return there == here ? to_s : from_s + (knot - here) / (there - here);
  if (!passed(to_s)) return to_s;
  double before = from_s, after = to_s;
  for (double half = (before + after) / 2; before < half && half < after; half = (before + after) / 2) {
    (passed(half) ? after : before) = half;
  }
  return after;
}

bool PrescribedMasses::enter_pieces(double time_s) {
  bool ended = false;
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    for (; motion_[i].end_s(piece_[i]) <= time_s; ++piece_[i]) ended = true;
  }
  return ended;
}

double PrescribedMasses::smooth_until_s(double time_s) const {
  double until_s = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    until_s = std::min(until_s, motion_[i].smooth_until_s(piece_[i], time_s));
  }
  return until_s;
}

void PrescribedMasses::place(double start_s, const MassPoint& commanded) {
  piece_.fill(0);
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    motion_[i].follow(start_s, {commanded.position[i], commanded.velocity[i], commanded.acceleration[i]}, 0);
  }
}

bool PrescribedMasses::lead(double start_s, double end_s, const PerMass& position, const PerMass& velocity) {
  // A position that a cubic reaches up to rounding is on it.
  constexpr double kRounding = 1e-14;
  const double h = end_s - start_s;
  bool other = false;
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    PrescribedMotion::Point start = motion_[i].at(0, start_s);
    double jerk = 2 * (velocity[i] - start.velocity - h * start.acceleration) / (h * h);
    const double reached = start.position + h * (start.velocity + h * (start.acceleration / 2 + h * jerk / 6));
    if (std::abs(reached - position[i]) > kRounding * (1 + std::abs(position[i]))) {
      const double mean = (position[i] - start.position) / h;
      start.acceleration = (6 * mean - 4 * start.velocity - 2 * velocity[i]) / h;
      jerk = 6 * (start.velocity + velocity[i] - 2 * mean) / (h * h);
      other = true;
    }
    motion_[i].follow(start_s, start, jerk);
  }
  return other;
}

MassPoint PrescribedMasses::at(double time_s) const {
  MassPoint p{};
  for (std::size_t i = 0; i < motion_.size(); ++i) {
    const PrescribedMotion::Point point = motion_[i].at(piece_[i], time_s);
    p.position[i] = point.position;
    p.velocity[i] = point.velocity;
    p.acceleration[i] = point.acceleration;
  }
  return p;
}

}  // namespace ballast::sim
