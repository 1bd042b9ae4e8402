// The scenario's prescribed motion of one mass, for the plant: piecewise cubic positions with the instants at which
// pieces change. A mass on a trajectory moves along its curve with the time itself as its coordinate, theta = t, in
// pieces from each of the table's times to the next: the curve's third derivative jumps there.
#pragma once

#include <vector>

#include "sim/scenario/scenario.h"

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

}  // namespace ballast::sim
