// The curve a mass moves on: zeta(theta), from the geometric centre (GC), in the body frame.
#pragma once

#include <cmath>

#include "firmware/model/types.h"

namespace ballast::firmware {

enum class RailShape : std::uint8_t {
  kCircle,  // zeta = origin + radius (axis_cos cos(theta) + axis_sin sin(theta)), theta in rad
  kLine,    // zeta = origin + axis_cos theta, theta in m
};

// Inert data; build with circle(), circle_about() or line(), which normalise.
struct Rail {
  RailShape shape = RailShape::kLine;
  Vector3 origin_B_m = Vector3::Zero();   // centre of the circle, theta = 0 of the line
  Vector3 axis_cos_B = Vector3::UnitX();  // unit; direction of the line
  Vector3 axis_sin_B = Vector3::UnitZ();  // unit, perpendicular to axis_cos_B; unused by a line
  Real radius_m = 0;                      // of the circle; unused by a line
};

// zeta, zeta' and zeta'' (derivatives by theta), body frame.
template <class T>
struct RailPoint {
  Eigen::Matrix<T, 3, 1> position;
  Eigen::Matrix<T, 3, 1> d1;
  Eigen::Matrix<T, 3, 1> d2;
};

// Any scalar T with sin and cos, so that derivatives by complex step are possible.
template <class T>
[[gnu::always_inline]] inline RailPoint<T> evaluate(const Rail& rail, const T& theta) {
  using std::cos;
  using std::sin;
  RailPoint<T> p;
  if (rail.shape == RailShape::kCircle) {
    const T c = rail.radius_m * cos(theta);
    const T s = rail.radius_m * sin(theta);
    for (int j = 0; j < 3; ++j) {
      const T radial = rail.axis_cos_B[j] * c + rail.axis_sin_B[j] * s;
      p.position[j] = rail.origin_B_m[j] + radial;
      p.d1[j] = rail.axis_sin_B[j] * c - rail.axis_cos_B[j] * s;
      p.d2[j] = -radial;
    }
  } else {
    for (int j = 0; j < 3; ++j) {
      p.position[j] = rail.origin_B_m[j] + rail.axis_cos_B[j] * theta;
      p.d1[j] = T(rail.axis_cos_B[j]);
      p.d2[j] = T(0);
    }
  }
  return p;
}

// Circle in the plane of two orthonormal axes.
Rail circle(const Vector3& center_B_m, Real radius_m, const Vector3& axis_cos_B, const Vector3& axis_sin_B);

// The paper's circle, r B(n) (cos theta, 0, sin theta), about the GC, with n the unit vector of the given azimuth and
// elevation and B = [n, b2, -b1] from Frisvad's b1, b2 (PHYSICS.md section 2; Frisvad 2012, listing 2): theta = 0 lies
// on n.
Rail circle_about(Real radius_m, Real azimuth_rad, Real elevation_rad);

// Line through origin; direction is normalised here and must not be zero.
Rail line(const Vector3& origin_B_m, const Vector3& direction_B);

}  // namespace ballast::firmware
