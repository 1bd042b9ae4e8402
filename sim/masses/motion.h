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

  // Replaces the motion by one piece: from start_s on with this jerk.
  void follow(double start_s, const Point& start, double jerk);

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
  explicit PrescribedMasses(const std::vector<Mass>& masses) : motion_(masses.begin(), masses.end()) {}

  void restart() { piece_.fill(0); }
  // Enters the pieces that have begun by time_s, which never goes back but after restart(). True: a piece has ended.
  bool enter_pieces(double time_s);
  // The first instant after time_s at which a motion is not smooth.
  [[nodiscard]] double smooth_until_s(double time_s) const;
  [[nodiscard]] MassPoint at(double time_s) const;

  // The motions of ideal masses, which are known from one control tick to the next.
  //
  // place() puts the masses where they are commanded to be at start_s, with rates and accelerations. The accelerations
  // stay until lead() is called.
  void place(double start_s, const MassPoint& commanded);
  // Leads the masses from where they are at start_s to a commanded position and velocity at end_s. Between them the
  // acceleration is a linear function of time, as that of a commanded motion is inside a piece. It begins with the
  // acceleration of place() unless a piece of the motion ends in between. True: it begins with another one.
  bool lead(double start_s, double end_s, const PerMass& position, const PerMass& velocity);

 private:
  std::vector<PrescribedMotion> motion_;
  std::array<std::size_t, kMaxMasses> piece_{};
};

}  // namespace ballast::sim
