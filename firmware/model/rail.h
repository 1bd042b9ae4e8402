// The curve a mass moves on: zeta(theta), from the geometric centre (GC), in the body frame.
#pragma once

#include <cmath>
#include <complex>
#include <limits>

#include "firmware/model/sin_cos.h"
#include "firmware/model/types.h"

namespace ballast::firmware {

enum class RailShape : std::uint8_t {
  kCircle,  // zeta = origin + radius (axis_cos cos(theta) + axis_sin sin(theta)), theta in rad
  kLine,    // zeta = origin + axis_cos theta, theta in m
  kSpline,  // a C2 cubic through knots at equal distances of theta, its arc length in m
};

inline constexpr int kMaxRailPieces = 64;

// A point of a spline and the second derivative there.
struct RailKnot {
  Vector3 position_B_m = Vector3::Zero();
  Vector3 d2_B_per_m = Vector3::Zero();
};

// Inert data. Build circles and lines with circle(), circle_about() or line(), which normalise. The builder of a spline
// (sim/masses/spline_rail.h) makes it C2, and |zeta'| = 1 within a tolerance that it states.
struct Rail {
  RailShape shape = RailShape::kLine;
  Vector3 origin_B_m = Vector3::Zero();   // centre of the circle, theta = 0 of the line
  Vector3 axis_cos_B = Vector3::UnitX();  // unit; direction of the line
  Vector3 axis_sin_B = Vector3::UnitZ();  // unit, perpendicular to axis_cos_B; unused by a line
  Real radius_m = 0;                      // of the circle; unused by a line
  // Rail coordinates of the stops at the ends of a line or an open spline. Infinite: no stop.
  Real lower_end = -std::numeric_limits<Real>::infinity();
  Real upper_end = std::numeric_limits<Real>::infinity();

  // Splines only. Piece k goes from knot k, at theta = k piece_length_m, to knot k + 1. A closed spline repeats with
  // its length; its last knot equals its first. An open spline continues straight beyond its ends, along the tangents
  // there, so zeta'' jumps to 0.
  bool closed = false;
  int piece_count = 0;      // 1..kMaxRailPieces
  Real piece_length_m = 0;  // h
  std::array<RailKnot, kMaxRailPieces + 1> knots{};
};

// Splines only.
inline Real length_m(const Rail& rail) { return static_cast<Real>(rail.piece_count) * rail.piece_length_m; }

// zeta, zeta' and zeta'' (derivatives by theta), body frame.
template <class T>
struct RailPoint {
  Eigen::Matrix<T, 3, 1> position;
  Eigen::Matrix<T, 3, 1> d1;
  Eigen::Matrix<T, 3, 1> d2;
};

// zeta = a zeta_k + b zeta_k+1 + ((a^3 - a) zeta''_k + (b^3 - b) zeta''_k+1) h^2 / 6 with b = theta / h - k, a = 1 - b;
// the piece is chosen by the real part. Not inlined, so that the other shapes stay small where they are.
template <class T>
[[gnu::noinline]] RailPoint<T> evaluate_spline(const Rail& rail, T theta) {
  const Real length = length_m(rail), h = rail.piece_length_m;
  Real along = std::real(theta);
  if (rail.closed) {
    theta -= length * std::floor(along / length);
    along = std::real(theta);
  }
  RailPoint<T> p;
  const bool below = along<0, beyond = along> length;
  const T outside = below ? theta : theta - length;  // along the tangent of an open rail's end
  if (below || beyond) theta = T(below ? 0 : length);
  // NaN selects the first piece.
  const Real place = std::real(theta) / h;
  const int last = rail.piece_count - 1;
  const int k = place > 0 ? (place < static_cast<Real>(last) ? static_cast<int>(place) : last) : 0;
  const RailKnot &from = rail.knots[static_cast<std::size_t>(k)], &to = rail.knots[static_cast<std::size_t>(k + 1)];
  const T b = theta / h - static_cast<Real>(k), a = T(1) - b;
  const T bend_from = (a * a * a - a) * (h * h / 6), bend_to = (b * b * b - b) * (h * h / 6);
  const T turn_from = (T(1) - T(3) * a * a) * (h / 6), turn_to = (T(3) * b * b - T(1)) * (h / 6);
  for (int j = 0; j < 3; ++j) {
    const Real d2_from = from.d2_B_per_m[j], d2_to = to.d2_B_per_m[j];
    p.position[j] = a * from.position_B_m[j] + b * to.position_B_m[j] + bend_from * d2_from + bend_to * d2_to;
    p.d1[j] = (to.position_B_m[j] - from.position_B_m[j]) / h + turn_from * d2_from + turn_to * d2_to;
    p.d2[j] = a * d2_from + b * d2_to;
    if (below || beyond) {
      p.position[j] += outside * p.d1[j];
      p.d2[j] = T(0);
    }
  }
  return p;
}

// T: any scalar that sin_cos() accepts. Complex numbers give derivatives by complex step.
template <class T>
[[gnu::always_inline]] inline RailPoint<T> evaluate(const Rail& rail, const T& theta) {
  RailPoint<T> p;
  if (rail.shape == RailShape::kCircle) {
    const SinCos<T> angle = sin_cos(theta);
    const T c = rail.radius_m * angle.cos;
    const T s = rail.radius_m * angle.sin;
    for (int j = 0; j < 3; ++j) {
      const T radial = rail.axis_cos_B[j] * c + rail.axis_sin_B[j] * s;
      p.position[j] = rail.origin_B_m[j] + radial;
      p.d1[j] = rail.axis_sin_B[j] * c - rail.axis_cos_B[j] * s;
      p.d2[j] = -radial;
    }
  } else if (rail.shape == RailShape::kSpline) {
    p = evaluate_spline(rail, theta);
  } else {
    for (int j = 0; j < 3; ++j) {
      p.position[j] = rail.origin_B_m[j] + rail.axis_cos_B[j] * theta;
      p.d1[j] = T(rail.axis_cos_B[j]);
      p.d2[j] = T(0);
    }
  }
  return p;
}

// A circle in the plane of two axes, which are made orthonormal.
Rail circle(const Vector3& center_B_m, Real radius_m, const Vector3& axis_cos_B, const Vector3& axis_sin_B);

// The paper's circle, r B(n) (cos theta, 0, sin theta), about the GC, with n the unit vector of the given azimuth and
// elevation and B = [n, b2, -b1] from Frisvad's b1, b2 (physics.md section 2; Frisvad 2012, listing 2): theta = 0 lies
// on n.
Rail circle_about(Real radius_m, Real azimuth_rad, Real elevation_rad);

// A line through `origin`. The direction is normalised and must not be zero.
Rail line(const Vector3& origin_B_m, const Vector3& direction_B);

}  // namespace ballast::firmware
