// A rail through points: a firmware rail of shape kSpline, whose coordinate is the arc length.
//
// First, a C2 cubic with the chord length as its parameter (cubic_spline.h: periodic if closed, else not-a-knot) goes
// through the points. Points are then taken from it at equal distances along its arc. The rail is the C2 cubic through
// those, with the distance as its parameter (periodic, or with the first curve's unit tangents at the ends).
//
// So |zeta'| = 1 at the knots up to (length / pieces)^4 and in between up to its third power. The rail passes the given
// points at a distance that falls as the fourth power of length / pieces where the first curve is smooth. Both are
// measured. They are no error of the dynamics, which use the rail as it is: zeta and its exact derivatives.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "firmware/model/rail.h"

namespace ballast::sim {

struct SplineRail {
  firmware::Rail rail;      // theta = 0 at the first point
  double length_m;          // of the rail: period of theta if closed; NaN or infinite where the points allow no rail
  double speed_error;       // greatest | |zeta'| - 1 |, at 32 places of each piece
  double point_distance_m;  // greatest distance of a given point from the rail where it is meant to pass it
  std::size_t worst_point;  // that point
  double farthest_m;        // greatest |zeta|
  double farthest_theta_m;  // theta there
};

// At least 2 points, 3 if closed (the first is not repeated at the end), neighbours distinct; 1 to kMaxRailPieces
// pieces.
SplineRail spline_rail(const std::vector<Eigen::Vector3d>& points, bool closed, int pieces = firmware::kMaxRailPieces);

}  // namespace ballast::sim
