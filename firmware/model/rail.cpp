#include "firmware/model/rail.h"

namespace ballast::firmware {

namespace {

Vector3 unit(const Vector3& v) { return v / std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

}  // namespace

Rail circle(const Vector3& center_B_m, Real radius_m, const Vector3& axis_cos_B, const Vector3& axis_sin_B) {
  Rail rail;
  rail.shape = RailShape::kCircle;
  rail.origin_B_m = center_B_m;
  rail.radius_m = radius_m;
  rail.axis_cos_B = unit(axis_cos_B);
  // One Gram-Schmidt step, so that axes written with a few digits give a true circle.
  rail.axis_sin_B = unit(axis_sin_B - rail.axis_cos_B * rail.axis_cos_B.dot(axis_sin_B));
  return rail;
}

Rail circle_about(Real radius_m, Real azimuth_rad, Real elevation_rad) {
  const SinCos<Real> elevation = sin_cos(elevation_rad), azimuth = sin_cos(azimuth_rad);
  const Real nx = elevation.cos * azimuth.cos;
  const Real ny = elevation.cos * azimuth.sin;
  const Real nz = elevation.sin;
  Vector3 b1(0, -1, 0);
  if (nz >= Real(-0.9999999)) {
    const Real a = 1 / (1 + nz);
    b1 = Vector3(1 - nx * nx * a, -nx * ny * a, -nx);
  }
  // B = [n, b2, -b1] is applied to (cos theta, 0, sin theta), so b2 is not needed.
  return circle(Vector3::Zero(), radius_m, Vector3(nx, ny, nz), -b1);
}

Rail line(const Vector3& origin_B_m, const Vector3& direction_B) {
  Rail rail;
  rail.shape = RailShape::kLine;
  rail.origin_B_m = origin_B_m;
  rail.axis_cos_B = unit(direction_B);
  return rail;
}

}  // namespace ballast::firmware
