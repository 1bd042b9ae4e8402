// The scenario's prescribed motion, for the plant: piecewise cubic positions and the instants at which pieces change. A
// mass on a trajectory moves along its curve with the time itself as its coordinate, theta = t. Its pieces go from each
// of the table's times to the next, because the curve's third derivative jumps there.
#pragma once

#include <array>
#include <vector>

#include "sim/masses/mass.h"

namespace ballast::sim {

class PrescribedMotion {
 public:
  explicit PrescribedMotion(const Mass& mass);

  struct Point {
    double position, velocity, acceleration;
  };

  // Pieces are numbered 0.. in order; the last one (constant velocity) has no end. A piece is evaluated as its own
  // cubic even at its ends, so the caller chooses the side of a jump by naming the piece.
  [[nodiscard]] Point at(std::size_t piece, double time_s) const;
  [[nodiscard]] double end_s(std::size_t piece) const;  // infinity for the last
  // The first instant after time_s at which the piece ends or the mass passes a knot of its spline rail, where zeta'''
  // jumps.
  [[nodiscard]] double smooth_until_s(std::size_t piece, double time_s) const;

 private:
  [[nodiscard]] double next_knot_s(std::size_t piece, double from_s, double to_s) const;

  struct Piece {
    double start_s, position, velocity, acceleration, jerk;
  };
  std::vector<Piece> pieces_;
  double knot_spacing_ = 0;  // of a spline rail; else 0
  Trajectory trajectory_;
};

using PerMass = std::array<double, kMaxMasses>;

// Rail coordinates of all masses and their rates. A mass on a trajectory has the time, 1 and 0.
struct MassPoint {
  PerMass position, velocity, acceleration;
};

// The motions of all masses, and the piece that each is in.
class PrescribedMasses {
 public:
  using Pieces = std::array<std::size_t, kMaxMasses>;

  explicit PrescribedMasses(const std::vector<Mass>& masses) : motion_(masses.begin(), masses.end()) {}

  [[nodiscard]] const Pieces& pieces() const { return piece_; }
  void restart() { piece_.fill(0); }
  // Enters the pieces that have begun by time_s, which never goes back but after restart(). True: a piece has ended.
  bool enter_pieces(double time_s);
  // The first instant after time_s at which a motion is not smooth.
  [[nodiscard]] double smooth_until_s(double time_s) const;
  [[nodiscard]] MassPoint at(double time_s) const { return at(time_s, piece_); }
  [[nodiscard]] MassPoint at(double time_s, const Pieces& pieces) const;

 private:
  std::vector<PrescribedMotion> motion_;
  Pieces piece_{};
};

}  // namespace ballast::sim
