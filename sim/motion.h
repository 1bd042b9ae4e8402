// The scenario's prescribed motion of one mass, for the plant: piecewise cubic positions with the instants at which
// pieces change.
#pragma once

#include <vector>

#include "sim/scenario.h"

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
  [[nodiscard]] std::size_t last_piece() const { return pieces_.size() - 1; }
  [[nodiscard]] double end_s(std::size_t piece) const;  // infinity for the last

 private:
  struct Piece {
    double start_s, position, velocity, acceleration, jerk;
  };
  std::vector<Piece> pieces_;
};

}  // namespace ballast::sim
